"""A recording through perception and filter, in its own time, without losing a frame."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction

from midastouch_bringup.ros.launch_parts import check_arguments, check_rviz, declared, ending_node, included, wanted
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["replay"].values())


def generate_launch_description() -> LaunchDescription:
    """Node `replay`, the localisation and RViz. Launch files that are included get these arguments by their names."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=wanted("use_rviz")),
            included("localization"),
            included("rviz", condition=wanted("use_rviz")),
            ending_node("midastouch_bringup", "replay", ["bag", "rate", "loop"]),
        ]
    )
