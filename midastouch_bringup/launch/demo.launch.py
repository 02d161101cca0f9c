"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

The first run makes the slide and the codebook under out/ of the current folder; later runs reuse them.
"""

import subprocess

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.substitutions import ExecutableInPackage

SHARE = get_package_share_directory("midastouch_bringup")
YES_NO = ["true", "false"]
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"
ARGUMENTS = {
    "object": ("handle_tool", "Bundled object that is slid over"),
    "loop": ("true", "Play again and again"),
    "prepare": ("true", "Make the slide and the codebook if they are missing"),
    "bag": (["out/slides/", LaunchConfiguration("object")], "Slide, made if it is missing"),
}


def generate_launch_description():
    """Make the slide and the codebook if they are missing, then include replay.launch.py with these arguments."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=YES_NO if v in YES_NO else None)
        for name, (v, text) in ARGUMENTS.items()
    ]
    replay = PythonLaunchDescriptionSource(f"{SHARE}/launch/replay.launch.py")
    return LaunchDescription(
        [
            # not on the rest of the network, unless the user has chosen otherwise
            SetEnvironmentVariable(REACH, EnvironmentVariable(REACH, default_value="LOCALHOST")),
            *declared,
            OpaqueFunction(function=prepare, condition=IfCondition(LaunchConfiguration("prepare"))),
            IncludeLaunchDescription(replay),
        ]
    )


def prepare(context):
    """Have the command make the files that are missing, before anything is started."""
    given = context.launch_configurations
    midastouch = ExecutableInPackage("midastouch", "midastouch_tools").perform(context)
    subprocess.run([midastouch, "run", "demo", f"object:={given['object']}", "--prepare"], check=True)
