"""The DIGIT's driver."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction

from midastouch_bringup.ros.launch_parts import check_arguments, declared, lifecycle_node
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["driver"].values())


def generate_launch_description() -> LaunchDescription:
    """Start node `digit_driver`."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            lifecycle_node("digit_driver", "digit_driver", ["autostart", "use_sim_time", "serial", "sensor_prefix"]),
        ]
    )
