"""A DIGIT on a UR arm: driver, mount, localisation, RViz."""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EqualsSubstitution, LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from midastouch_bringup.ros.launch_parts import COMMON, declare, include, start


def generate_launch_description() -> LaunchDescription:
    """Everything but the arm's own driver, unless `arm` asks for that too."""
    ur_control = PathJoinSubstitution([FindPackageShare("ur_robot_driver"), "launch", "ur_control.launch.py"])
    ur_driver = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(ur_control),
        launch_arguments={
            **{name: LaunchConfiguration(name) for name in ("robot_ip", "ur_type", "tf_prefix", "use_mock_hardware")},
            "launch_rviz": "false",
        }.items(),
        condition=IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), "ur_driver")),
    )
    rtde = IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), "rtde"))
    return LaunchDescription(
        [
            *declare(*COMMON, "serial", "autostart", "composed", "background"),
            *declare("object", "mesh", "codebook", "init_mode", "seed"),
            *declare("arm", "robot_ip", "ur_type", "use_mock_hardware", "tf_prefix", "frames_file", "tool_frame"),
            *declare("sensor_prefix", "use_rviz", "rviz_config"),
            ur_driver,
            start("midastouch_bringup", "ur_tf", condition=rtde),
            include("mount"),
            include("driver"),
            include("localization"),
            include("rviz", condition=IfCondition(LaunchConfiguration("use_rviz"))),
        ]
    )
