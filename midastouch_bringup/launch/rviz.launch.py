"""RViz with our view; closing it ends the launch."""

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SHARE = get_package_share_directory("midastouch_bringup")
YES_NO = ["true", "false"]
ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes; one per sensor, e.g. digit_left"),
    "use_sim_time": ("false", "Take the time from /clock"),
    "rviz_config": (f"{SHARE}/rviz/midastouch.rviz", "RViz configuration"),
}


def generate_launch_description():
    """Start RViz in the namespace, so that the relative topics of its configuration resolve there."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=YES_NO if v in YES_NO else None)
        for name, (v, text) in ARGUMENTS.items()
    ]
    return LaunchDescription(
        [
            *declared,
            Node(
                package="rviz2",
                executable="rviz2",
                namespace=LaunchConfiguration("namespace"),
                arguments=["-d", LaunchConfiguration("rviz_config")],
                parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
                output="screen",
                # while launch is shutting down a second Shutdown fails
                on_exit=lambda _, context: None if context.is_shutdown else Shutdown(reason="RViz was closed"),
            ),
        ]
    )
