"""Perception and filter: in processes of their own, or in one."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import declare, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `tdn`, `tcn`, `particle_filter`."""
    return LaunchDescription([*declare("localization"), *start("localization")])
