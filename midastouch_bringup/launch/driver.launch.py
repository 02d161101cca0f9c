"""The DIGIT's driver."""

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
    "serial",
    "sensor_prefix",
)


def generate_launch_description() -> LaunchDescription:
    """Node `digit_driver`."""
    use_respawn = UseRespawn()
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            LifecycleNode(
                package="digit_driver",
                executable="digit_driver",
                name="digit_driver",
                namespace=LaunchConfiguration("namespace"),
                parameters=[MergedParameters("digit_driver", ["autostart", "use_sim_time", "serial", "sensor_prefix"])],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                prefix=bound_to_launch(),
                output="screen",
                respawn=use_respawn,
                respawn_delay=2.0,
                on_exit=use_respawn.or_end_launch,
            ),
        ]
    )
