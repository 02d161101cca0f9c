"""A recording through perception and filter, in its own time, without losing a frame."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from midastouch_bringup.ros.launch_parts import (
    MergedParameters,
    bound_to_launch,
    check_arguments,
    check_rviz,
    end_launch_if_failed,
)

SHARE = Path(get_package_share_directory("midastouch_bringup"))
ARGUMENTS = [
    DeclareLaunchArgument(
        "bag", default_value="", description="YCB-Slide sequence folder, or bag (.mcap file or rosbag2 folder)"
    ),
    DeclareLaunchArgument(
        "rate", default_value="", description="Recorded seconds per second; 0: as fast as the filter follows"
    ),
    DeclareLaunchArgument("loop", default_value="false", choices=["true", "false"], description="Play again and again"),
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
        "use_sim_time", default_value="true", choices=["true", "false"], description="Take the time from /clock"
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
        "setup_file",
        default_value=str(SHARE / "config" / "replay.yaml"),
        description="What this launch file itself changes in params_file",
    ),
    DeclareLaunchArgument(
        "composed",
        default_value="false",
        choices=["true", "false"],
        description="Run perception and filter in one process",
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
        "tf_prefix", default_value="", description="Put before the arm's frames and joints, as in the UR driver"
    ),
    DeclareLaunchArgument(
        "sensor_prefix", default_value="", description="Put before the sensor's frames; for several sensors, e.g. left_"
    ),
    DeclareLaunchArgument("use_rviz", default_value="true", choices=["true", "false"], description="Start RViz"),
    DeclareLaunchArgument(
        "rviz_config", default_value=str(SHARE / "rviz" / "midastouch.rviz"), description="RViz configuration"
    ),
]


def generate_launch_description() -> LaunchDescription:
    """Node `replay`, the localisation and RViz. Launch files that are included get these arguments by their names."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=IfCondition(LaunchConfiguration("use_rviz"))),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "localization.launch.py"))),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "rviz.launch.py")),
                condition=IfCondition(LaunchConfiguration("use_rviz")),
            ),
            # ends by itself; the others stay, to be looked at
            Node(
                package="midastouch_bringup",
                executable="replay",
                namespace=LaunchConfiguration("namespace"),
                parameters=[MergedParameters("replay", ["bag", "rate", "loop"])],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                prefix=bound_to_launch(),
                output="screen",
                on_exit=end_launch_if_failed,
            ),
        ]
    )
