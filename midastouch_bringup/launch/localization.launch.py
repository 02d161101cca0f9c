"""Perception and filter: in processes of their own, or in one."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import check, declare, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `tdn`, `tcn`, `particle_filter`."""
    return LaunchDescription([*declare("localization"), check("localization"), *start("localization")])
