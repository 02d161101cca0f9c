"""From tactile images to codes."""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_parts import COMMON, declare, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `tdn` and `tcn`."""
    return LaunchDescription(
        [
            *declare(*COMMON, "serial", "background", "sensor_prefix"),
            start("midastouch_perception", "tdn"),
            start("midastouch_perception", "tcn"),
        ]
    )
