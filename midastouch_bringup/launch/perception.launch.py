"""From tactile images to codes."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

from midastouch_bringup.ros.launch_parts import (
    MergedParameters,
    UseRespawn,
    bound_to_launch,
    check_arguments,
)

SHARE = Path(get_package_share_directory("midastouch_bringup"))
ARGUMENTS = [
    DeclareLaunchArgument(
        "namespace", default_value="", description="Namespace of all nodes; one per sensor, e.g. digit_left"
    ),
    DeclareLaunchArgument(
        "params_file", default_value=str(SHARE / "config" / "midastouch.yaml"), description="Parameters of all nodes"
    ),
    DeclareLaunchArgument(
        "params_overlay",
        default_value="",
        description="Parameter file of yours, over all others; it may hold only what differs",
    ),
    DeclareLaunchArgument(
        "use_sim_time", default_value="false", choices=["true", "false"], description="Take the time from /clock"
    ),
    DeclareLaunchArgument(
        "use_respawn", default_value="false", choices=["true", "false"], description="Start a node again after it died"
    ),
    DeclareLaunchArgument(
        "log_level",
        default_value="info",
        choices=["debug", "info", "warn", "error", "fatal"],
        description="What the nodes log",
    ),
    DeclareLaunchArgument(
        "autostart",
        default_value="",
        choices=["", "true", "false"],
        description="Configure and activate the lifecycle nodes without a manager; empty: as in params_file",
    ),
    DeclareLaunchArgument(
        "serial",
        default_value="",
        description="Serial number of the DIGIT; empty: the only one, whose captured background is not kept",
    ),
    DeclareLaunchArgument(
        "background",
        default_value="",
        description="No-contact image of this sensor, or a folder of its images; empty: from the first images, or "
        "from bag",
    ),
    DeclareLaunchArgument(
        "sensor_model",
        default_value="",
        description="Kind of the sensor: digit_real, digit_tacto (simulated), gelsight_mini, or a YAML file; "
        "empty: as in the parameter files",
    ),
    DeclareLaunchArgument(
        "sensor_prefix", default_value="", description="Put before the sensor's frames; for several sensors, e.g. left_"
    ),
]


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
