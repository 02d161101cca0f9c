"""A simulated DIGIT in place of the driver."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

from midastouch_bringup.ros.launch_parts import (
    MergedParameters,
    UseRespawn,
    bound_to_launch,
    check_arguments,
    declared,
)

ARGUMENTS = declared(
    "namespace",
    "params_file",
    "params_overlay",
    "use_sim_time",
    "use_respawn",
    "log_level",
    "autostart",
    "object",
    "mesh",
    "sensor_model",
    "sensor_prefix",
)


def generate_launch_description() -> LaunchDescription:
    """Node `digit_sim`, moved by TF."""
    use_respawn = UseRespawn()
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            LifecycleNode(
                package="midastouch_bringup",
                executable="digit_sim",
                name="digit_sim",
                namespace=LaunchConfiguration("namespace"),
                # seed: an argument of explore.launch.py, which includes this file
                parameters=[
                    MergedParameters(
                        "digit_sim",
                        ["autostart", "use_sim_time", "object", "mesh", "sensor_model", "sensor_prefix", "seed"],
                    )
                ],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                prefix=bound_to_launch(),
                output="screen",
                respawn=use_respawn,
                respawn_delay=2.0,
                on_exit=use_respawn.or_end_launch,
            ),
        ]
    )
