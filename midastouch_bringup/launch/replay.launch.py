"""A recording through perception and filter, in its own time, without losing a frame."""

from launch import LaunchDescription
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration

from midastouch_bringup.ros.launch_parts import COMMON, SHARE, declare, include, start


def generate_launch_description() -> LaunchDescription:
    """Nodes `replay`, `tdn`, `tcn`, `particle_filter` and RViz."""
    own_time = {"use_sim_time": "true", "params_overlay": str(SHARE / "config" / "replay.yaml")}
    return LaunchDescription(
        [
            *declare(*(name for name in COMMON if name not in own_time), **own_time),
            *declare("bag", "rate", "loop", "composed", "object", "mesh", "codebook", "init_mode", "seed"),
            *declare("tf_prefix", "sensor_prefix", "use_rviz", "rviz_config"),
            include("localization"),
            include("rviz", condition=IfCondition(LaunchConfiguration("use_rviz"))),
            start("midastouch_bringup", "replay"),
        ]
    )
