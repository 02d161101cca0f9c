"""A recording through perception and filter, in its own time, without losing a frame."""

from launch import LaunchDescription
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration

from midastouch_bringup.ros.launch_parts import declare, declare_recording, include, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `replay`, `tdn`, `tcn`, `particle_filter` and RViz."""
    return LaunchDescription(
        [
            *declare("bag", "object"),
            *declare_recording(),
            include("localization"),
            include("rviz", condition=IfCondition(LaunchConfiguration("use_rviz"))),
            start("midastouch_bringup", "replay"),
        ]
    )
