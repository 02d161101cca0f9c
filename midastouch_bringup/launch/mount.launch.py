"""Static TF from the arm's tool to the DIGIT's frames, and the sensor's shape for RViz."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import Command
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = get_package_share_directory("midastouch_bringup")
YES_NO = ["true", "false"]
ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes; one per sensor, e.g. digit_left"),
    "use_respawn": ("false", "Start a node again after it died"),
    "log_level": ("info", "What the nodes log: debug, info, warn, error or fatal"),
    "use_rviz": ("true", "Start RViz"),
    "frames_file": (f"{SHARE}/config/frames.yaml", "Hand-eye calibration and mount"),
    "tool_frame": ("", "Frame the sensor is mounted on; empty: as in frames_file"),
    "tf_prefix": ("", "Put before the arm's frames and joints, as in the UR driver"),
    "sensor_prefix": ("", "Put before the sensor's frames; for several sensors, e.g. left_"),
}


def generate_launch_description():
    """Declare the arguments, then `start`."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=YES_NO if v in YES_NO else None)
        for name, (v, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def start(context):
    """Start node `mount_tf`, and with RViz a robot_state_publisher for the mount alone: the arm's stays untouched."""
    given = context.launch_configurations
    frames_file = str(Path(given["frames_file"]).resolve())
    mount = {name: given[name] for name in ("tool_frame", "tf_prefix", "sensor_prefix") if given[name]}
    respawn = given["use_respawn"] == "true"

    def ended(event, context):
        # bad input (2) stays bad; after a Shutdown the launch would exit with 0
        if not context.is_shutdown and not (respawn and event.returncode != 2):
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    common = {
        "namespace": given["namespace"],
        "ros_arguments": ["--log-level", given["log_level"]],
        "output": "screen",
        "respawn": respawn,
        "respawn_delay": 2.0,
        "on_exit": ended,
    }
    nodes = [
        Node(
            package="midastouch_motion",
            executable="mount_tf",
            parameters=[{"frames_file": frames_file, **mount}],
            **common,
        )
    ]
    if given["use_rviz"] == "true":
        words = ["xacro", f"{SHARE}/urdf/digit_mount.urdf.xacro", f"frames_file:={frames_file}"]
        words += [f"tool_frame:={given['tool_frame']}", f"tf_prefix:={given['tf_prefix']}"]
        description = Command(" ".join([*words, f"prefix:={given['sensor_prefix']}"]))
        # first, as what is begun before an action fails would go on
        nodes.insert(
            0,
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                name="digit_mount_publisher",
                parameters=[{"robot_description": ParameterValue(description, value_type=str)}],
                # only what RViz draws: mount_tf publishes the transforms
                remappings=[("robot_description", "digit_description"), ("/tf_static", "digit_tf_static")],
                **common,
            ),
        )
    return nodes
