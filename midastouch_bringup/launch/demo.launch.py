"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

Slide and codebook are made by the first run, under out/ of the present folder, and kept.
"""

from launch import LaunchDescription
from launch.actions import SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable

from midastouch_bringup.output_paths import demo_slide
from midastouch_bringup.ros.launch_parts import check, declare, start_prepared


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `replay`."""
    reach = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    return LaunchDescription(
        [
            # Nobody else on the network sees the demo's nodes, unless the user has said so.
            SetEnvironmentVariable(reach, EnvironmentVariable(reach, default_value="LOCALHOST")),
            *declare("demo"),
            check("demo"),
            start_prepared("demo", lambda given: {"bag": str(demo_slide(given["object"]))}),
        ]
    )
