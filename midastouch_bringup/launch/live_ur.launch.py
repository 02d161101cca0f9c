"""A DIGIT on a UR arm: driver, mount, localisation, RViz."""

from launch import LaunchContext, LaunchDescription
from launch.actions import IncludeLaunchDescription, LogInfo, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from midastouch_bringup.ros.launch_parts import check, declare, require_package, start, when


def generate_launch_description() -> LaunchDescription:
    """Everything but the arm's own driver, unless `arm` asks for that too."""
    ur_driver = OpaqueFunction(function=_ur_driver, condition=when(("arm", "ur_driver")))
    return LaunchDescription([*declare("live_ur"), check("live_ur"), ur_driver, *start("live_ur")])


def _ur_driver(context: LaunchContext) -> list:
    require_package("ur_robot_driver", "or start the arm yourself (arm:=running)")
    given = context.launch_configurations
    arguments = {name: given[name] for name in ("robot_ip", "ur_type", "tf_prefix", "use_mock_hardware")}
    actions = []
    if given["kinematics_params_file"]:
        arguments["kinematics_params_file"] = given["kinematics_params_file"]
    elif given["use_mock_hardware"] == "false":
        actions.append(
            LogInfo(
                msg="WARNING: without kinematics_params_file the tool may be centimetres off. "
                "Extract the arm's calibration: ros2 launch ur_calibration calibration_correction.launch.py"
            )
        )
    ur_control = PathJoinSubstitution([FindPackageShare("ur_robot_driver"), "launch", "ur_control.launch.py"])
    arguments["launch_rviz"] = "false"
    return [
        *actions,
        IncludeLaunchDescription(PythonLaunchDescriptionSource(ur_control), launch_arguments=arguments.items()),
    ]
