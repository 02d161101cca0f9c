"""From codes and transforms to the pose of the sensor on the object."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import check, declare, start


def generate_launch_description() -> LaunchDescription:
    """Node `particle_filter`."""
    return LaunchDescription([*declare("filter"), check("filter"), *start("filter")])
