"""A DIGIT on an arm: one that runs already (arm:=running), or a UR. Driver, mount, localisation, RViz."""

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import IncludeLaunchDescription, LogInfo, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from midastouch_bringup.ros.launch_parts import (
    arm_is,
    check_arguments,
    check_mount,
    check_package,
    check_rviz,
    declared,
    included,
    lasting_node,
    wanted,
)
from midastouch_bringup.ros.setups import SETUPS

ARGUMENTS = declared(SETUPS["live_ur"].values(), SETUPS["live_ur"].choices)


def generate_launch_description() -> LaunchDescription:
    """Start everything; the arm's own driver only with arm:=ur_driver.

    Included launch files receive these arguments by name.
    """
    return LaunchDescription(
        [
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_mount),
            OpaqueFunction(function=check_rviz, condition=wanted("use_rviz")),
            OpaqueFunction(
                function=check_package,
                args=["ur_robot_driver", "or start the arm yourself (arm:=running)"],
                condition=arm_is("ur_driver"),
            ),
            OpaqueFunction(function=ur_driver, condition=arm_is("ur_driver")),
            lasting_node("midastouch_motion", "ur_tf", ["arm", "robot_ip", "tf_prefix"], condition=arm_is("rtde")),
            included("mount"),
            included("driver"),
            included("localization"),
            included("rviz", condition=wanted("use_rviz")),
        ]
    )


def ur_driver(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Include the arm's driver, with the calibration of this particular arm if it is given."""
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
