"""Perception: from tactile images to codes."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction

from midastouch_bringup.ros.launch_parts import check_arguments, declared, lifecycle_node
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["perception"].values())


def generate_launch_description() -> LaunchDescription:
    """Start node `tdn` (`image_raw` to `tactile/points`) and node `tcn` (`tactile/points` to `tactile/code`)."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            # bag: an argument of replay.launch.py, which includes this file; a recording may hold its background
            lifecycle_node(
                "midastouch_perception",
                "tdn",
                ["autostart", "use_sim_time", "serial", "background", "bag", "sensor_model", "sensor_prefix"],
            ),
            lifecycle_node("midastouch_perception", "tcn", ["autostart", "use_sim_time", "sensor_model"]),
        ]
    )
