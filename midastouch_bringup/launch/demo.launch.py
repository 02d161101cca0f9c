"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

Slide and codebook are made by the first run, under out/ of the present folder, and kept.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import ExecuteProcess, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable
from launch_ros.substitutions import ExecutableInPackage

from midastouch_bringup.ros.launch_parts import declare, declare_recording, in_turn, include


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `replay`."""
    reach = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    return LaunchDescription(
        [
            # Nobody else on the network sees the demo's nodes, unless the user has said so.
            SetEnvironmentVariable(reach, EnvironmentVariable(reach, default_value="LOCALHOST")),
            *declare(object="handle_tool"),
            *declare_recording(loop="true"),
            OpaqueFunction(function=_make_and_play),
        ]
    )


def _make_and_play(context: LaunchContext) -> list:
    # here: `--show-args` need not wait for the libraries behind it
    from midastouch_bringup.codebooks import codebook_path

    name = context.launch_configurations["object"]
    slide, codebook = Path("out/slides") / name, codebook_path(name)
    missing = []
    if not slide.is_dir():
        missing.append(_midastouch("simulate", name, "--out", str(slide)))
    if not codebook.is_file():
        missing.append(_midastouch("build-codebook", name, "--out", str(codebook)))
    return in_turn(missing, include("replay", bag=str(slide)))


def _midastouch(*arguments: str) -> ExecuteProcess:
    command = ExecutableInPackage("midastouch", "midastouch_bringup")
    return ExecuteProcess(cmd=[command, *arguments], output="screen")
