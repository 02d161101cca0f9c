"""A simulated DIGIT in place of the driver."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import check, declare, start


def generate_launch_description() -> LaunchDescription:
    """Node `digit_sim`."""
    return LaunchDescription([*declare("digit_sim"), check("digit_sim"), *start("digit_sim")])
