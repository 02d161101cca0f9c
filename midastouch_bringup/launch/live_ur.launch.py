"""A DIGIT on a UR arm: driver, mount, localisation, RViz."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import IncludeLaunchDescription, LogInfo, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EqualsSubstitution, LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from midastouch_bringup.ros.launch_parts import (
    check_arguments,
    check_mount,
    check_package,
    check_rviz,
    declared,
    lasting_node,
)
from midastouch_bringup.ros.setups import SETUPS

SHARE = Path(get_package_share_directory("midastouch_bringup"))
ARGUMENTS = declared(SETUPS["live_ur"].values(), SETUPS["live_ur"].choices)


def generate_launch_description() -> LaunchDescription:
    """Everything but the arm's own driver, unless `arm` asks for that too.

    Launch files that are included get these arguments by their names.
    """
    arm_by_ur_driver = IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), "ur_driver"))
    arm_by_rtde = IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), "rtde"))
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_mount),
            OpaqueFunction(function=check_rviz, condition=IfCondition(LaunchConfiguration("use_rviz"))),
            OpaqueFunction(
                function=check_package,
                args=["ur_robot_driver", "or start the arm yourself (arm:=running)"],
                condition=arm_by_ur_driver,
            ),
            OpaqueFunction(function=ur_driver, condition=arm_by_ur_driver),
            lasting_node("midastouch_bringup", "ur_tf", ["arm", "robot_ip", "tf_prefix"], condition=arm_by_rtde),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "mount.launch.py"))),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "driver.launch.py"))),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "localization.launch.py"))),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "rviz.launch.py")),
                condition=IfCondition(LaunchConfiguration("use_rviz")),
            ),
        ]
    )


def ur_driver(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The arm's driver, with the calibration of this very arm if there is one."""
    given = context.launch_configurations
    arguments = {name: given[name] for name in ("robot_ip", "ur_type", "tf_prefix", "use_mock_hardware")}
    arguments["launch_rviz"] = "false"
    actions = []
    if given["kinematics_params_file"]:
        arguments["kinematics_params_file"] = given["kinematics_params_file"]
    elif given["use_mock_hardware"] == "false":
        actions.append(
            LogInfo(
                msg="WARNING: without kinematics_params_file the tool may be centimetres off. "
                "Extract the arm's calibration: ros2 launch ur_calibration calibration_correction.launch.py "
                f"robot_ip:={given['robot_ip']} target_filename:=$HOME/arm.yaml\n"
                "Then give kinematics_params_file:=$HOME/arm.yaml"
            )
        )
    ur_control = PathJoinSubstitution([FindPackageShare("ur_robot_driver"), "launch", "ur_control.launch.py"])
    return [
        *actions,
        IncludeLaunchDescription(PythonLaunchDescriptionSource(ur_control), launch_arguments=arguments.items()),
    ]
