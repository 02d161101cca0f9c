"""The DIGIT's driver."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import check, declare, start


def generate_launch_description() -> LaunchDescription:
    """Node `digit_driver`."""
    return LaunchDescription([*declare("driver"), check("driver"), *start("driver")])
