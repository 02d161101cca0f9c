"""A simulated finger explores an object by itself, until the filter knows the place. No hardware, no data.

The codebooks are made by the first run, under out/ of the present folder, and kept. `midastouch run explore` does the
same, takes keys, and ends with a page.
"""

from launch import LaunchDescription

from midastouch_bringup.ros.launch_arguments import explored
from midastouch_bringup.ros.launch_parts import check, declare, on_this_machine, start_prepared


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `digit_sim`, the localisation and `explorer`."""
    return LaunchDescription(
        [
            on_this_machine(),
            *declare("explore"),
            check("explore"),
            start_prepared("explore", explored),
        ]
    )
