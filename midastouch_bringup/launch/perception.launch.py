"""From tactile images to codes."""

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
    "background",
    "sensor_model",
    "sensor_prefix",
)


def generate_launch_description() -> LaunchDescription:
    """Nodes `tdn`, from `image_raw` to `tactile/points`, and `tcn`, from there to `tactile/code`."""
    use_respawn = UseRespawn()
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            LifecycleNode(
                package="midastouch_perception",
                executable="tdn",
                name="tdn",
                namespace=LaunchConfiguration("namespace"),
                # bag: an argument of replay.launch.py, which includes this file; a recording may hold its background
                parameters=[
                    MergedParameters(
                        "tdn",
                        ["autostart", "use_sim_time", "serial", "background", "bag", "sensor_model", "sensor_prefix"],
                    )
                ],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                prefix=bound_to_launch(),
                output="screen",
                respawn=use_respawn,
                respawn_delay=2.0,
                on_exit=use_respawn.or_end_launch,
            ),
            LifecycleNode(
                package="midastouch_perception",
                executable="tcn",
                name="tcn",
                namespace=LaunchConfiguration("namespace"),
                parameters=[MergedParameters("tcn", ["autostart", "use_sim_time", "sensor_model"])],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                prefix=bound_to_launch(),
                output="screen",
                respawn=use_respawn,
                respawn_delay=2.0,
                on_exit=use_respawn.or_end_launch,
            ),
        ]
    )
