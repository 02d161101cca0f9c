"""Perception and filter: each node in its own process, or all in one."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction
from launch.conditions import UnlessCondition
from launch.substitutions import LaunchConfiguration

from midastouch_bringup.ros.launch_arguments import OF_OBJECT
from midastouch_bringup.ros.launch_parts import (
    check_arguments,
    declared,
    included,
    lasting_node,
    say_if_no_object,
    wanted,
)
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["localization"].values())


def generate_launch_description() -> LaunchDescription:
    """Start nodes `tdn`, `tcn`, `particle_filter`. Included launch files receive these arguments by name."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            included("perception", condition=UnlessCondition(LaunchConfiguration("composed"))),
            included("filter", condition=UnlessCondition(LaunchConfiguration("composed"))),
            OpaqueFunction(function=say_if_no_object, condition=wanted("composed")),
            # no name: a name given to this process would rename all three nodes
            lasting_node(
                "midastouch_bringup",
                "all_in_one",
                # bag: an argument of replay.launch.py, which includes this file; a recording may hold its background
                [
                    *("autostart", "use_sim_time", "serial", "background", "bag", "sensor_model"),
                    *(*OF_OBJECT, "tf_prefix", "sensor_prefix"),
                ],
                condition=wanted("composed"),
            ),
        ]
    )
