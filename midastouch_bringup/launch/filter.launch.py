"""From codes and transforms to the pose of the sensor on the object."""

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
    "codebook",
    "objects",
    "init_mode",
    "preset",
    "fingers",
    "seed",
    "sensor_model",
    "tf_prefix",
    "sensor_prefix",
)


def generate_launch_description() -> LaunchDescription:
    """Node `particle_filter`, which hears `tactile/code`, `tactile/points` and `/tf`."""
    use_respawn = UseRespawn()
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            LifecycleNode(
                package="midastouch_filter",
                executable="particle_filter",
                name="particle_filter",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    MergedParameters(
                        "particle_filter",
                        [
                            "autostart",
                            "use_sim_time",
                            "object",
                            "mesh",
                            "codebook",
                            "objects",
                            "init_mode",
                            "preset",
                            "fingers",
                            "seed",
                            "sensor_model",
                            "tf_prefix",
                            "sensor_prefix",
                        ],
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
