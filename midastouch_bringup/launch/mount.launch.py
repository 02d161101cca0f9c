"""Static TF from the arm's tool to the DIGIT's frames, and the sensor's shape for RViz."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from midastouch_bringup.ros.launch_parts import UseRespawn, bound_to_launch, mount_description

SHARE = Path(get_package_share_directory("midastouch_bringup"))
ARGUMENTS = [
    DeclareLaunchArgument(
        "namespace", default_value="", description="Namespace of all nodes; one per sensor, e.g. digit_left"
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
        "frames_file", default_value=str(SHARE / "config" / "frames.yaml"), description="Hand-eye calibration and mount"
    ),
    DeclareLaunchArgument(
        "tool_frame",
        default_value="",
        description="Frame the sensor is mounted on, tool0 or tool0_controller; empty: as in frames_file",
    ),
    DeclareLaunchArgument(
        "tf_prefix", default_value="", description="Put before the arm's frames and joints, as in the UR driver"
    ),
    DeclareLaunchArgument(
        "sensor_prefix", default_value="", description="Put before the sensor's frames; for several sensors, e.g. left_"
    ),
]


def generate_launch_description() -> LaunchDescription:
    """A robot_state_publisher of its own: the arm's description stays untouched."""
    use_respawn = UseRespawn()
    return LaunchDescription(
        [
            *ARGUMENTS,
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                name="digit_mount_publisher",
                namespace=LaunchConfiguration("namespace"),
                # what xacro makes of urdf/digit_mount.urdf.xacro with frames_file, tool_frame and the prefixes
                parameters=[{"robot_description": ParameterValue(mount_description(), value_type=str)}],
                remappings=[("robot_description", "digit_description")],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                prefix=bound_to_launch(),
                respawn=use_respawn,
                respawn_delay=2.0,
                on_exit=use_respawn.or_end_launch,
            ),
        ]
    )
