"""A DIGIT on an arm: one that runs already (arm:=running), or a UR. Driver, mount, localisation, RViz."""

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SHARE = get_package_share_directory("midastouch_bringup")
YES_NO = ["true", "false"]
ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes; one per sensor, e.g. digit_left"),
    "params_file": (f"{SHARE}/config/midastouch.yaml", "Parameters of all nodes"),
    "setup_file": ("", "What this launch file itself changes in params_file"),
    "params_overlay": ("", "Parameter file of yours, over both; it may hold only what differs"),
    "use_respawn": ("false", "Start a node again after it died"),
    "log_level": ("info", "What the nodes log: debug, info, warn, error or fatal"),
    "robot_ip": ("", "Address of the arm; must be given with arm:=ur_driver and arm:=rtde"),
    "tcp_offset": ("", "With arm:=rtde: tool centre point on the teach pendant, [x, y, z, rx, ry, rz], m and rad"),
    "ur_type": ("ur5e", "Model of the arm, for arm:=ur_driver"),
    "kinematics_params_file": ("", "Calibration of this very arm (ur_calibration), for arm:=ur_driver"),
    "use_mock_hardware": ("false", "Mock arm, for arm:=ur_driver"),
    "tf_prefix": ("", "Put before the arm's frames and joints, as in the UR driver"),
    "sensor_model": ("digit_real", "Kind of the sensor: digit_real, gelsight_mini, or a YAML file"),
    "use_rviz": ("true", "Start RViz"),
}


def generate_launch_description():
    """Start everything; the arm's own driver only with arm:=ur_driver."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=YES_NO if v in YES_NO else None)
        for name, (v, text) in ARGUMENTS.items()
    ]
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "arm",
                default_value="running",
                choices=["running", "ur_driver", "rtde"],
                description="TF of the arm: of one that runs already, the UR ROS driver started here, or RTDE",
            ),
            *declared,
            OpaqueFunction(function=arm),
            included("mount"),
            included("driver"),
            included("localization"),
            included("rviz", IfCondition(LaunchConfiguration("use_rviz"))),
        ]
    )


def included(name, condition=None):
    """Another of our launch files. It receives the arguments of this one by name."""
    source = PythonLaunchDescriptionSource(f"{SHARE}/launch/{name}.launch.py")
    return IncludeLaunchDescription(source, condition=condition)


def arm(context):
    """Start node `ur_tf` with arm:=rtde, or the arm's own driver with arm:=ur_driver."""
    given = context.launch_configurations
    if given["arm"] != "running" and not given["robot_ip"] and given["use_mock_hardware"] == "false":
        raise RuntimeError(f"arm:={given['arm']}: at which address? Give that of its controller, robot_ip:=ADDRESS")
    if given["arm"] == "rtde" and not given["tcp_offset"]:
        raise RuntimeError("tcp_offset:=[x, y, z, rx, ry, rz]: as on the teach pendant, zeros if none is set there")
    if given["arm"] == "ur_driver":
        try:
            driver = get_package_share_directory("ur_robot_driver")
        except PackageNotFoundError as error:
            raise RuntimeError("ur_robot_driver is not installed (a system ROS has it); or give arm:=rtde") from error
        source = PythonLaunchDescriptionSource(f"{driver}/launch/ur_control.launch.py")
        words = ["robot_ip", "ur_type", "kinematics_params_file", "use_mock_hardware", "tf_prefix"]
        arguments = {name: given[name] for name in words if given[name] or name != "kinematics_params_file"}
        return [IncludeLaunchDescription(source, launch_arguments={**arguments, "launch_rviz": "false"}.items())]
    if given["arm"] != "rtde":
        return []
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    parameters = {name: given[name] for name in ("robot_ip", "tf_prefix") if given[name]}
    respawn = given["use_respawn"] == "true"

    def ended(event, context):
        # bad input (2) stays bad; after a Shutdown the launch would exit with 0
        if not context.is_shutdown and not (respawn and event.returncode != 2):
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return [
        Node(
            package="midastouch_motion",
            executable="ur_tf",
            namespace=given["namespace"],
            parameters=[*files, parameters, {"tcp_offset": LaunchConfiguration("tcp_offset")}],
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            respawn=respawn,
            respawn_delay=2.0,
            on_exit=ended,
        )
    ]
