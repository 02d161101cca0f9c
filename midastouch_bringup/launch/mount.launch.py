"""Static TF from the arm's tool to the DIGIT's frames, and the sensor's shape for RViz."""

from launch import LaunchDescription
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from midastouch_bringup.ros.launch_arguments import SHARE
from midastouch_bringup.ros.launch_parts import declare


def generate_launch_description() -> LaunchDescription:
    """A robot_state_publisher of its own: the arm's description stays untouched."""
    xacro = ["xacro ", str(SHARE / "urdf" / "digit_mount.urdf.xacro")]
    for argument, configuration in (
        ("frames_file", "frames_file"),
        ("tool_frame", "tool_frame"),
        ("tf_prefix", "tf_prefix"),
        ("prefix", "sensor_prefix"),
    ):
        xacro += [f" {argument}:=", LaunchConfiguration(configuration)]
    description = ParameterValue(Command(xacro), value_type=str)
    return LaunchDescription(
        [
            *declare("mount"),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                name="digit_mount_publisher",
                namespace=LaunchConfiguration("namespace"),
                parameters=[{"robot_description": description}],
                remappings=[("robot_description", "digit_description")],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                respawn=LaunchConfiguration("use_respawn"),
                respawn_delay=2.0,
            ),
        ]
    )
