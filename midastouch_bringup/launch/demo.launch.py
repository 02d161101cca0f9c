"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

Slide and codebook are made by the first run, under out/ of the present folder, and kept.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
    SetLaunchConfiguration,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.substitutions import ExecutableInPackage

from midastouch_bringup.output_paths import demo_slide
from midastouch_bringup.ros.launch_parts import check_arguments, check_rviz, declared, once_done
from midastouch_bringup.ros.setups import SETUPS

SHARE = Path(get_package_share_directory("midastouch_bringup"))
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"
ARGUMENTS = declared(SETUPS["demo"].values())


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then replay.launch.py, which gets these arguments by their names."""
    return LaunchDescription(
        [
            # nobody else on the network sees the nodes, unless the user has said so
            SetEnvironmentVariable(REACH, EnvironmentVariable(REACH, default_value="LOCALHOST")),
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=IfCondition(LaunchConfiguration("use_rviz"))),
            # a process of its own: the libraries for it may be missing in the Python of launch
            ExecuteProcess(
                cmd=[
                    ExecutableInPackage("midastouch", "midastouch_bringup"),
                    "run",
                    "demo",
                    ["object:=", LaunchConfiguration("object")],
                    "--prepare",
                ],
                output="screen",
                on_exit=once_done(play),
            ),
        ]
    )


def play(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The replay of the slide."""
    return [
        SetLaunchConfiguration("bag", str(demo_slide(context.launch_configurations["object"]))),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "replay.launch.py"))),
    ]
