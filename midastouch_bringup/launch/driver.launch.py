"""The DIGIT's driver."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import COMMON, declare, start


def generate_launch_description() -> LaunchDescription:
    """Node `digit_driver`."""
    return LaunchDescription(
        [*declare(*COMMON, "serial", "autostart", "sensor_prefix"), start("digit_driver", "digit_driver")]
    )
