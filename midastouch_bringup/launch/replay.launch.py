"""A recording through perception and filter, in its own time, without losing a frame."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import check, declare, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `replay`, `tdn`, `tcn`, `particle_filter` and RViz."""
    return LaunchDescription([*declare("replay"), check("replay"), *start("replay")])
