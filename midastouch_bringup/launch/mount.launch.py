"""Static TF from the arm's tool to the DIGIT's frames, and the sensor's shape for RViz."""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from midastouch_bringup.ros.launch_parts import UseRespawn, bound_to_launch, declared, mount_description
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["mount"].values())


def generate_launch_description() -> LaunchDescription:
    """Start a robot_state_publisher for the mount alone, so that the arm's description stays untouched."""
    use_respawn = UseRespawn()
    return LaunchDescription(
        [
            *ARGUMENTS,
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                name="digit_mount_publisher",
                namespace=LaunchConfiguration("namespace"),
                # urdf/digit_mount.urdf.xacro, expanded by xacro with frames_file, tool_frame and the prefixes
                parameters=[{"robot_description": ParameterValue(mount_description(), value_type=str)}],
                remappings=[("robot_description", "digit_description")],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                **bound_to_launch("robot_state_publisher"),
                respawn=use_respawn,
                respawn_delay=2.0,
                on_exit=use_respawn.or_end_launch,
            ),
        ]
    )
