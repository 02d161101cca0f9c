"""A simulated finger or arm explores an object by itself, until the filter knows its pose. No hardware, no data.

The first run makes the codebooks under out/ of the current folder; later runs reuse them. `midastouch run explore` does
the same, and also takes keys and ends with a page of results.
"""

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import OpaqueFunction, SetLaunchConfiguration
from launch_ros.actions import Node

from midastouch_bringup.ros.launch_parameters import explored
from midastouch_bringup.ros.launch_parts import (
    arm_is,
    check_arguments,
    check_rviz,
    declared,
    ending_node,
    included,
    lasting_node,
    lifecycle_node,
    prepared,
    to_ourselves,
    wanted,
)
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["explore"].values(), SETUPS["explore"].choices)


def generate_launch_description() -> LaunchDescription:
    """Make missing codebooks, then start `digit_sim`, the localisation, the simulated finger or arm, and `explorer`."""
    return LaunchDescription(
        [
            to_ourselves(),
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=wanted("use_rviz")),
            prepared("explore", ["object", "mesh", "codebook", "objects", "arm"], explore),
        ]
    )


def explore(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Start the nodes. Included launch files receive the arguments of this one by name."""
    return [
        # mesh, codebook and objects, as they were just made
        *(SetLaunchConfiguration(name, path) for name, path in explored(context.launch_configurations).items()),
        included("digit_sim"),
        included("localization"),
        included("rviz", condition=wanted("use_rviz")),
        _simulated_arm("midastouch_simulation", "simulated_finger", "finger"),
        _simulated_arm("midastouch_simulation", "mujoco_arm", "mujoco"),
        lifecycle_node(
            "midastouch_motion",
            "contact_controller",
            ["autostart", "tf_prefix", "sensor_prefix"],
            condition=arm_is("mujoco"),
        ),
        ending_node("midastouch_motion", "explorer", ["mesh", "seed", "tf_prefix", "sensor_prefix"]),
    ]


def _simulated_arm(package: str, executable: str, name: str) -> Node:
    """Start the node that moves the gel if arm:=`name`."""
    return lasting_node(package, executable, ["mesh", "seed", "tf_prefix", "sensor_prefix"], condition=arm_is(name))
