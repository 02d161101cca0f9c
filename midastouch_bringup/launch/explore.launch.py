"""A simulated finger explores an object by itself, until the filter knows the place. No hardware, no data.

The codebooks are made by the first run, under out/ of the present folder, and kept. `midastouch run explore` does the
same, takes keys, and ends with a page.
"""

from launch import LaunchDescription
from launch.actions import SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable

from midastouch_bringup.ros.launch_arguments import explored
from midastouch_bringup.ros.launch_parts import check, declare, start_prepared


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `digit_sim`, the localisation and `explorer`."""
    reach = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    return LaunchDescription(
        [
            # Nobody else on the network sees the nodes, unless the user has said so.
            SetEnvironmentVariable(reach, EnvironmentVariable(reach, default_value="LOCALHOST")),
            *declare("explore"),
            check("explore"),
            start_prepared("explore", explored),
        ]
    )
