"""Replay of a recording through perception and filter, in the recording's own time, without losing a frame."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction

from midastouch_bringup.ros.launch_parts import check_arguments, check_rviz, declared, ending_node, included, wanted
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["replay"].values())


def generate_launch_description() -> LaunchDescription:
    """Start node `replay`, the localisation and RViz. Included launch files receive these arguments by name."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=wanted("use_rviz")),
            included("localization"),
            included("rviz", condition=wanted("use_rviz")),
            ending_node("midastouch_tools", "replay", ["bag", "rate", "loop"]),
        ]
    )
