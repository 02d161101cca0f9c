"""Perception and filter: in processes of their own, or in one."""

from launch import LaunchDescription
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration

from midastouch_bringup.ros.launch_parts import COMMON, declare, include, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `tdn`, `tcn`, `particle_filter`."""
    composed = LaunchConfiguration("composed")
    return LaunchDescription(
        [
            *declare(*COMMON, "serial", "composed", "background"),
            *declare("object", "mesh", "codebook", "init_mode", "seed"),
            *declare("tf_prefix", "sensor_prefix"),
            start("midastouch_bringup", "all_in_one", condition=IfCondition(composed)),
            include("perception", condition=UnlessCondition(composed)),
            include("filter", condition=UnlessCondition(composed)),
        ]
    )
