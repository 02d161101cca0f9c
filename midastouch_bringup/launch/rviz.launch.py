"""RViz with our view; closing it ends the launch."""

from launch import LaunchContext, LaunchDescription
from launch.actions import Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from midastouch_bringup.ros.launch_arguments import ARGUMENTS
from midastouch_bringup.ros.launch_parts import bound_to_launch, declared

TAKEN = declared({name: ARGUMENTS[name].default for name in ("namespace", "use_sim_time", "rviz_config")})


def generate_launch_description() -> LaunchDescription:
    """Start RViz in the namespace, so that the relative topics of its configuration resolve there."""
    return LaunchDescription(
        [
            *TAKEN,
            Node(
                package="rviz2",
                executable="rviz2",
                namespace=LaunchConfiguration("namespace"),
                arguments=["-d", LaunchConfiguration("rviz_config")],
                parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
                **bound_to_launch("rviz2"),
                output="screen",
                on_exit=_close,
            ),
        ]
    )


def _close(_event: ProcessExited, context: LaunchContext) -> Shutdown | None:
    # a second Shutdown event fails in launch_ros, whose ROS node is gone by then
    return None if context.is_shutdown else Shutdown(reason="RViz was closed")
