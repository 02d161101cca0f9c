"""A DIGIT on a UR arm that touches an object by itself, until the filter knows its pose.

It moves only while `contact_controller/enable` is repeated, and explores once `explorer/resume` is called. Each run is
recorded.
"""

from launch import LaunchDescription
from launch.actions import OpaqueFunction

from midastouch_bringup.ros.launch_parts import (
    arm_is,
    check_arguments,
    declared,
    ending_node,
    included,
    lasting_node,
    lifecycle_node,
)
from midastouch_bringup.ros.setups import SETUPS

OF_EXPLORER = ["use_sim_time", "object", "mesh", "seed", "tf_prefix", "sensor_prefix"]
ARGUMENTS = declared(SETUPS["explore_ur"].values(), SETUPS["explore_ur"].choices)


def generate_launch_description() -> LaunchDescription:
    """Start the nodes of `live_ur`, `contact_controller`, `recorder`, `explorer`, and with arm:=rtde `ur_speed`.

    Included launch files receive these arguments by name.
    """
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            included("live_ur"),
            lifecycle_node(
                "midastouch_motion",
                "ur_speed",
                ["autostart", "arm", "robot_ip", "tf_prefix", "sensor_prefix"],
                condition=arm_is("rtde"),
            ),
            lifecycle_node(
                "midastouch_motion",
                "contact_controller",
                ["autostart", "use_sim_time", "sensor_model", "tf_prefix", "sensor_prefix"],
            ),
            lasting_node("midastouch_tools", "recorder", ["record"]),
            ending_node("midastouch_motion", "explorer", OF_EXPLORER),
        ]
    )
