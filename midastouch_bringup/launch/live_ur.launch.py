"""A DIGIT on a UR arm: driver, mount, localisation, RViz."""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from midastouch_bringup.ros.launch_parts import declare, start, when


def generate_launch_description() -> LaunchDescription:
    """Everything but the arm's own driver, unless `arm` asks for that too."""
    ur_control = PathJoinSubstitution([FindPackageShare("ur_robot_driver"), "launch", "ur_control.launch.py"])
    ur_driver = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(ur_control),
        launch_arguments={
            **{name: LaunchConfiguration(name) for name in ("robot_ip", "ur_type", "tf_prefix", "use_mock_hardware")},
            "launch_rviz": "false",
        }.items(),
        condition=when(("arm", "ur_driver")),
    )
    return LaunchDescription([*declare("live_ur"), ur_driver, *start("live_ur")])
