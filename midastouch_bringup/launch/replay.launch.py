"""A recording through perception and filter, in its own time, without losing a frame."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from midastouch_bringup.ros.launch_parts import (
    check_arguments,
    check_rviz,
    declared,
    ending_node,
)
from midastouch_bringup.ros.setups import SETUPS

SHARE = Path(get_package_share_directory("midastouch_bringup"))
ARGUMENTS = declared(SETUPS["replay"].values())


def generate_launch_description() -> LaunchDescription:
    """Node `replay`, the localisation and RViz. Launch files that are included get these arguments by their names."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=IfCondition(LaunchConfiguration("use_rviz"))),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "localization.launch.py"))),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "rviz.launch.py")),
                condition=IfCondition(LaunchConfiguration("use_rviz")),
            ),
            ending_node("midastouch_bringup", "replay", ["bag", "rate", "loop"]),
        ]
    )
