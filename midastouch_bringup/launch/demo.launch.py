"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

Slide and codebook are made by the first run, under out/ of the present folder, and kept.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import ExecuteProcess, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable
from launch_ros.substitutions import ExecutableInPackage

from midastouch_bringup.output_paths import demo_slide
from midastouch_bringup.ros.launch_parts import check, declare, ends_the_launch, start


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `replay`."""
    reach = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    return LaunchDescription(
        [
            # Nobody else on the network sees the demo's nodes, unless the user has said so.
            SetEnvironmentVariable(reach, EnvironmentVariable(reach, default_value="LOCALHOST")),
            *declare("demo"),
            check("demo"),
            OpaqueFunction(function=_make_and_play),
        ]
    )


def _make_and_play(context: LaunchContext) -> list:
    name = context.launch_configurations["object"]
    failed = ends_the_launch()

    def play(event, context):
        # a lifecycle node that is launched once the shutdown has begun keeps launch from ending
        if event.returncode != 0 or context.is_shutdown:
            return failed(event, context)
        return start("demo", bag=str(demo_slide(name)))

    # a process of its own: the libraries for it may be missing in the Python of launch
    midastouch = ExecutableInPackage("midastouch", "midastouch_bringup")
    command = [midastouch, "run", "demo", f"object:={name}", "--prepare"]
    return [ExecuteProcess(cmd=command, output="screen", on_exit=play)]
