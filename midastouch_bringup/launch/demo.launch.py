"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

The first run makes the slide and the codebook under out/ of the current folder; later runs reuse them.
"""

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import OpaqueFunction, SetLaunchConfiguration

from midastouch_bringup.ros.launch_parts import (
    check_arguments,
    check_rviz,
    declared,
    included,
    prepared,
    to_ourselves,
    wanted,
)
from midastouch_bringup.ros.setups import SETUPS
from midastouch_common.output_paths import demo_slide

ARGUMENTS = declared(SETUPS["demo"].values())


def generate_launch_description() -> LaunchDescription:
    """Make the slide and the codebook if they are missing, then include replay.launch.py with these arguments."""
    return LaunchDescription(
        [
            to_ourselves(),
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=wanted("use_rviz")),
            prepared("demo", ["object"], play),
        ]
    )


def play(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Include the replay of the slide."""
    return [
        SetLaunchConfiguration("bag", str(demo_slide(context.launch_configurations["object"]))),
        included("replay"),
    ]
