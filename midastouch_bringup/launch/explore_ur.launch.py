"""A DIGIT on a UR arm that touches an object by itself, until the filter knows its pose.

It moves only while `slider/enable` is repeated, and explores once `explorer/resume` is called. Each run is recorded.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EqualsSubstitution, LaunchConfiguration

from midastouch_bringup.ros.launch_parts import (
    check_arguments,
    declared,
    ending_node,
    lasting_node,
    lifecycle_node,
)
from midastouch_bringup.ros.setups import SETUPS

SHARE = Path(get_package_share_directory("midastouch_bringup"))
OF_EXPLORER = ["use_sim_time", "object", "mesh", "seed", "tf_prefix", "sensor_prefix"]
ARGUMENTS = declared(SETUPS["explore_ur"].values(), SETUPS["explore_ur"].choices)


def generate_launch_description() -> LaunchDescription:
    """What `live_ur` starts, `slider`, with arm:=rtde `ur_speed`, `recorder` and `explorer`.

    Launch files that are included get these arguments by their names.
    """
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "live_ur.launch.py"))),
            lifecycle_node(
                "midastouch_motion",
                "ur_speed",
                ["autostart", "arm", "robot_ip", "tf_prefix", "sensor_prefix"],
                condition=IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), "rtde")),
            ),
            lifecycle_node(
                "midastouch_motion",
                "slider",
                ["autostart", "use_sim_time", "sensor_model", "tf_prefix", "sensor_prefix"],
            ),
            lasting_node("midastouch_bringup", "recorder", ["record"]),
            ending_node("midastouch_bringup", "explorer", OF_EXPLORER),
        ]
    )
