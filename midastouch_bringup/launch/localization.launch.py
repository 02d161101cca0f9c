"""Perception and filter: each node in its own process, or all in one."""

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition, UnlessCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

SHARE = get_package_share_directory("midastouch_bringup")


def generate_launch_description():
    """Start nodes `tdn`, `tcn` and `particle_filter`; `--show-args` lists the arguments of all included files."""
    composed = LaunchConfiguration("composed")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "composed",
                default_value="false",
                choices=["true", "false"],
                description="Run perception and filter in one process",
            ),
            included("perception", UnlessCondition(composed)),
            included("filter", UnlessCondition(composed)),
            included("composed", IfCondition(composed)),
        ]
    )


def included(name, condition=None):
    """Another of our launch files. It receives the arguments of this one by name."""
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(f"{SHARE}/launch/{name}.launch.py"), condition=condition
    )
