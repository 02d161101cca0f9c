"""Replay of a recording through perception and filter, in the recording's own time, without losing a frame."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = get_package_share_directory("midastouch_bringup")
YES_NO = ["true", "false"]
TURNS = ["0", "90", "180", "270"]
ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes; one per sensor, e.g. digit_left"),
    "params_file": (f"{SHARE}/config/midastouch.yaml", "Parameters of all nodes"),
    "setup_file": (f"{SHARE}/config/replay.yaml", "What this launch file itself changes in params_file"),
    "params_overlay": ("", "Parameter file of yours, over both; it may hold only what differs"),
    "use_respawn": ("false", "Start a node again after it died"),
    "log_level": ("info", "What the nodes log: debug, info, warn, error or fatal"),
    "use_sim_time": ("true", "Take the time from /clock"),
    "bag": (None, "YCB-Slide sequence folder, or bag (.mcap file or rosbag2 folder)"),
    "remap": ("", "Topics of a bag that are played on others: FROM:=TO, separated by spaces"),
    "rotation": ("0", "Turn of the images, degrees counter-clockwise; 90 for those in the camera's own order"),
    "rate": ("", "Recorded seconds per second; 0: as fast as the filter follows"),
    "loop": ("false", "Play again and again"),
    "background": ("", "No-contact image of this sensor, or a folder of its images; empty: from the first images"),
    "use_rviz": ("true", "Start RViz"),
}


def generate_launch_description():
    """Start node `replay`, the localisation and RViz."""
    declared = [
        DeclareLaunchArgument(
            name,
            default_value=v,
            description=text,
            choices=YES_NO if v in YES_NO else TURNS if name == "rotation" else None,
        )
        for name, (v, text) in ARGUMENTS.items()
    ]
    return LaunchDescription(
        [
            *declared,
            OpaqueFunction(function=own_background),
            included("localization"),
            included("rviz", IfCondition(LaunchConfiguration("use_rviz"))),
            OpaqueFunction(function=start),
        ]
    )


def included(name, condition=None):
    """Another of our launch files. It receives the arguments of this one by name."""
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(f"{SHARE}/launch/{name}.launch.py"), condition=condition
    )


def own_background(context):
    """Take the no-contact image in a sequence's folder or beside a bag or, without one, the folder's images."""
    bag = Path((given := context.launch_configurations)["bag"])
    for path in (bag / "background.png", bag.with_suffix(".background.png"), bag / "tactile_images", bag / "frames"):
        if not given["background"] and path.exists():
            given["background"] = str(path.resolve())


def start(context):
    """Start node `replay`. An argument that is empty leaves its parameter to the files."""
    given = context.launch_configurations
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    parameters = {
        "source": ParameterValue(LaunchConfiguration("bag"), value_type=str),
        "remap": ParameterValue(LaunchConfiguration("remap"), value_type=str),
        "rotation": int(given["rotation"]),
        "loop": given["loop"] == "true",
    }
    if given["rate"]:
        parameters["rate"] = float(given["rate"])

    def ended(event, context):
        # when it has played everything the others stay, to be looked at
        if event.returncode and not context.is_shutdown:
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return [
        Node(
            package="midastouch_tools",
            executable="replay",
            namespace=given["namespace"],
            parameters=[*files, parameters],
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            on_exit=ended,
        )
    ]
