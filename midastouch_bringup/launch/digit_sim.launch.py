"""A simulated DIGIT in place of the driver."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction

from midastouch_bringup.ros.launch_parts import check_arguments, declared, lifecycle_node
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["digit_sim"].values())


def generate_launch_description() -> LaunchDescription:
    """Start node `digit_sim`, which TF moves."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            # seed: an argument of explore.launch.py, which includes this file
            lifecycle_node(
                "midastouch_simulation",
                "digit_sim",
                ["autostart", "use_sim_time", "object", "mesh", "sensor_model", "sensor_prefix", "seed"],
            ),
        ]
    )
