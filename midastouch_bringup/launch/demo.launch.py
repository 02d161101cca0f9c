"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

Slide and codebook are made by the first run, under out/ of the present folder, and kept.
"""

from launch import LaunchDescription

from midastouch_bringup.output_paths import demo_slide
from midastouch_bringup.ros.launch_parts import check, declare, on_this_machine, start_prepared


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `replay`."""
    return LaunchDescription(
        [
            on_this_machine(),
            *declare("demo"),
            check("demo"),
            start_prepared("demo", lambda given: {"bag": str(demo_slide(given["object"]))}),
        ]
    )
