"""The filter: from codes and transforms to the pose of the sensor on the object."""

from launch import LaunchDescription
from launch.actions import OpaqueFunction

from midastouch_bringup.ros.launch_arguments import OF_OBJECT
from midastouch_bringup.ros.launch_parts import check_arguments, declared, lifecycle_node, say_if_no_object
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["filter"].values())


def generate_launch_description() -> LaunchDescription:
    """Start node `particle_filter`, which subscribes to `tactile/code`, `tactile/points` and `/tf`."""
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=say_if_no_object),
            lifecycle_node(
                "midastouch_filter",
                "particle_filter",
                ["autostart", "use_sim_time", *OF_OBJECT, "sensor_model", "tf_prefix", "sensor_prefix"],
            ),
        ]
    )
