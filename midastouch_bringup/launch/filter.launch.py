"""From codes and transforms to the pose of the sensor on the object."""

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
        "object",
        default_value="",
        description="Name of a bundled object: gives mesh, and codebook from out/codebooks (midastouch build-codebook)",
    ),
    DeclareLaunchArgument("mesh", default_value="", description="Mesh of the object, metres: a path or package://..."),
    DeclareLaunchArgument(
        "codebook", default_value="", description="Codebook of that mesh; empty: a coarse one is built"
    ),
    DeclareLaunchArgument(
        "objects",
        default_value="",
        description="In place of object, where nobody knows which one it is: names of bundled objects, codebooks, "
        "folders of codebooks and meshes, separated by ','; an exploration adds the object that is "
        "touched",
    ),
    DeclareLaunchArgument(
        "init_mode",
        default_value="",
        choices=["", "uniform", "pose", "wait"],
        description="Start: over the whole surface, at initial_pose, or once a pose is given",
    ),
    DeclareLaunchArgument(
        "preset",
        default_value="",
        choices=["", "fast", "balanced"],
        description="Filter settings between run time and error (fast: max_particles 1000, refined_modes 1; "
        "balanced: the defaults); those in a parameter file go over them",
    ),
    DeclareLaunchArgument(
        "fingers",
        default_value="",
        description="Further sensors on the same object, NAMESPACE:GEL_FRAME separated by ',', e.g. "
        "/right:right_digit_gel_frame",
    ),
    DeclareLaunchArgument(
        "seed", default_value="", description="Seed of the filter; in an exploration also of sensor and finger"
    ),
    DeclareLaunchArgument(
        "sensor_model",
        default_value="",
        description="Kind of the sensor: digit_real, digit_tacto (simulated), gelsight_mini, or a YAML file; "
        "empty: as in the parameter files",
    ),
    DeclareLaunchArgument(
        "tf_prefix", default_value="", description="Put before the arm's frames and joints, as in the UR driver"
    ),
    DeclareLaunchArgument(
        "sensor_prefix", default_value="", description="Put before the sensor's frames; for several sensors, e.g. left_"
    ),
]


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
