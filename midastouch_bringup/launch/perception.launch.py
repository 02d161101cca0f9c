"""From tactile images to codes."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import check, declare, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `tdn` and `tcn`."""
    return LaunchDescription([*declare("perception"), check("perception"), *start("perception")])
