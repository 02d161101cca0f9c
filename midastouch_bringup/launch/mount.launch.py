"""Static TF from the arm's tool to the DIGIT's frames, and the sensor's shape for RViz."""

from launch import LaunchContext, LaunchDescription
from launch.actions import OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from midastouch_bringup.ros.launch_parts import bound_to_launch, declare, ends_the_launch, mount_description


def generate_launch_description() -> LaunchDescription:
    """A robot_state_publisher of its own: the arm's description stays untouched."""
    return LaunchDescription([*declare("mount"), OpaqueFunction(function=_publisher)])


def _publisher(context: LaunchContext) -> list[Node]:
    respawn = context.launch_configurations["use_respawn"] == "true"
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            name="digit_mount_publisher",
            namespace=LaunchConfiguration("namespace"),
            parameters=[{"robot_description": ParameterValue(mount_description(), value_type=str)}],
            remappings=[("robot_description", "digit_description")],
            arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
            prefix=bound_to_launch(),
            respawn=respawn,
            respawn_delay=2.0,
            on_exit=None if respawn else ends_the_launch(),
        )
    ]
