"""A recording through perception and filter, in its own time, without losing a frame."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from midastouch_bringup.ros.launch_parts import (
    MergedParameters,
    bound_to_launch,
    check_arguments,
    check_rviz,
    declared,
    end_launch_if_failed,
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
            # ends by itself; the others stay, to be looked at
            Node(
                package="midastouch_bringup",
                executable="replay",
                namespace=LaunchConfiguration("namespace"),
                parameters=[MergedParameters("replay", ["bag", "rate", "loop"])],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                **bound_to_launch("replay"),
                output="screen",
                on_exit=end_launch_if_failed,
            ),
        ]
    )
