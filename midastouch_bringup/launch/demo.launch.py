"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

Slide and codebook are made by the first run, under out/ of the present folder, and kept.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import ExecuteProcess, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable
from launch_ros.substitutions import ExecutableInPackage

from midastouch_bringup.ros.launch_parts import declare, in_turn, start
from midastouch_bringup.ros.setups import demo_preparations, demo_slide


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `replay`."""
    reach = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    return LaunchDescription(
        [
            # Nobody else on the network sees the demo's nodes, unless the user has said so.
            SetEnvironmentVariable(reach, EnvironmentVariable(reach, default_value="LOCALHOST")),
            *declare("demo"),
            OpaqueFunction(function=_make_and_play),
        ]
    )


def _make_and_play(context: LaunchContext) -> list:
    name = context.launch_configurations["object"]
    (play,) = start("demo", bag=str(demo_slide(name)))
    return in_turn([_midastouch(arguments) for arguments in demo_preparations(name)], play)


def _midastouch(arguments: list[str]) -> ExecuteProcess:
    command = ExecutableInPackage("midastouch", "midastouch_bringup")
    return ExecuteProcess(cmd=[command, *arguments], output="screen")
