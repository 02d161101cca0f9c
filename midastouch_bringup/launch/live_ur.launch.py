"""A DIGIT on a UR arm: driver, mount, localisation, RViz."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, LogInfo, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EqualsSubstitution, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from midastouch_bringup.ros.launch_parts import (
    MergedParameters,
    UseRespawn,
    bound_to_launch,
    check_arguments,
    check_mount,
    check_package,
    check_rviz,
)

SHARE = Path(get_package_share_directory("midastouch_bringup"))
ARGUMENTS = [
    DeclareLaunchArgument(
        "namespace", default_value="", description="Namespace of all nodes; one per sensor, e.g. digit_left"
    ),
    DeclareLaunchArgument(
        "params_file", default_value=str(SHARE / "config" / "midastouch.yaml"), description="Parameters of all nodes"
    ),
    DeclareLaunchArgument(
        "params_overlay",
        default_value="",
        description="Parameter file of yours, over all others; it may hold only what differs",
    ),
    DeclareLaunchArgument(
        "use_sim_time", default_value="false", choices=["true", "false"], description="Take the time from /clock"
    ),
    DeclareLaunchArgument(
        "use_respawn", default_value="false", choices=["true", "false"], description="Start a node again after it died"
    ),
    DeclareLaunchArgument(
        "log_level",
        default_value="info",
        choices=["debug", "info", "warn", "error", "fatal"],
        description="What the nodes log",
    ),
    DeclareLaunchArgument(
        "autostart",
        default_value="",
        choices=["", "true", "false"],
        description="Configure and activate the lifecycle nodes without a manager; empty: as in params_file",
    ),
    DeclareLaunchArgument(
        "composed",
        default_value="false",
        choices=["true", "false"],
        description="Run perception and filter in one process",
    ),
    DeclareLaunchArgument(
        "serial",
        default_value="",
        description="Serial number of the DIGIT; empty: the only one, whose captured background is not kept",
    ),
    DeclareLaunchArgument(
        "background",
        default_value="",
        description="No-contact image of this sensor, or a folder of its images; empty: from the first images, or "
        "from bag",
    ),
    DeclareLaunchArgument(
        "sensor_model",
        default_value="digit_real",
        description="Kind of the sensor: digit_real, digit_tacto (simulated), gelsight_mini, or a YAML file; "
        "empty: as in the parameter files",
    ),
    DeclareLaunchArgument(
        "object",
        default_value="",
        description="Name of a bundled object: gives mesh, and codebook from out/codebooks (midastouch build-codebook)",
    ),
    DeclareLaunchArgument("mesh", default_value="", description="Mesh of the object, metres: a path or package://..."),
    DeclareLaunchArgument(
        "codebook", default_value="", description="Codebook of that mesh; empty: a coarse one is built"
    ),
    DeclareLaunchArgument(
        "objects",
        default_value="",
        description="In place of object, where nobody knows which one it is: names of bundled objects, codebooks, "
        "folders of codebooks and meshes, separated by ','; an exploration adds the object that is "
        "touched",
    ),
    DeclareLaunchArgument(
        "init_mode",
        default_value="",
        choices=["", "uniform", "pose", "wait"],
        description="Start: over the whole surface, at initial_pose, or once a pose is given",
    ),
    DeclareLaunchArgument(
        "preset",
        default_value="",
        choices=["", "fast", "balanced"],
        description="Filter settings between run time and error (fast: max_particles 1000, refined_modes 1; "
        "balanced: the defaults); those in a parameter file go over them",
    ),
    DeclareLaunchArgument(
        "fingers",
        default_value="",
        description="Further sensors on the same object, NAMESPACE:GEL_FRAME separated by ',', e.g. "
        "/right:right_digit_gel_frame",
    ),
    DeclareLaunchArgument(
        "seed", default_value="", description="Seed of the filter; in an exploration also of sensor and finger"
    ),
    DeclareLaunchArgument(
        "arm",
        default_value="running",
        choices=["running", "ur_driver", "rtde"],
        description="Where TF of the arm comes from: already running, the UR ROS driver started here, or ur_tf "
        "over RTDE",
    ),
    DeclareLaunchArgument(
        "robot_ip", default_value="", description="Address of the arm; must be given with arm:=ur_driver and arm:=rtde"
    ),
    DeclareLaunchArgument(
        "ur_type",
        default_value="ur5e",
        choices=[
            "ur3",
            "ur5",
            "ur10",
            "ur3e",
            "ur5e",
            "ur7e",
            "ur10e",
            "ur12e",
            "ur16e",
            "ur8long",
            "ur15",
            "ur18",
            "ur20",
            "ur30",
        ],
        description="Model of the arm, for arm:=ur_driver",
    ),
    DeclareLaunchArgument(
        "kinematics_params_file",
        default_value="",
        description="Calibration of this very arm (ur_calibration), for arm:=ur_driver; without it the tool may be "
        "centimetres off",
    ),
    DeclareLaunchArgument(
        "use_mock_hardware",
        default_value="false",
        choices=["true", "false"],
        description="Mock arm, for arm:=ur_driver",
    ),
    DeclareLaunchArgument(
        "tf_prefix", default_value="", description="Put before the arm's frames and joints, as in the UR driver"
    ),
    DeclareLaunchArgument(
        "frames_file", default_value=str(SHARE / "config" / "frames.yaml"), description="Hand-eye calibration and mount"
    ),
    DeclareLaunchArgument(
        "tool_frame",
        default_value="",
        description="Frame the sensor is mounted on, tool0 or tool0_controller; empty: as in frames_file",
    ),
    DeclareLaunchArgument(
        "sensor_prefix", default_value="", description="Put before the sensor's frames; for several sensors, e.g. left_"
    ),
    DeclareLaunchArgument("use_rviz", default_value="true", choices=["true", "false"], description="Start RViz"),
    DeclareLaunchArgument(
        "rviz_config", default_value=str(SHARE / "rviz" / "midastouch.rviz"), description="RViz configuration"
    ),
]


def generate_launch_description() -> LaunchDescription:
    """Everything but the arm's own driver, unless `arm` asks for that too.

    Launch files that are included get these arguments by their names.
    """
    arm_by_ur_driver = IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), "ur_driver"))
    arm_by_rtde = IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), "rtde"))
    use_respawn = UseRespawn()
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
            Node(
                package="midastouch_bringup",
                executable="ur_tf",
                namespace=LaunchConfiguration("namespace"),
                parameters=[MergedParameters("ur_tf", ["arm", "robot_ip", "tf_prefix"])],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                prefix=bound_to_launch(),
                output="screen",
                respawn=use_respawn,
                respawn_delay=2.0,
                on_exit=use_respawn.or_end_launch,
                condition=arm_by_rtde,
            ),
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
                "Extract the arm's calibration: ros2 launch ur_calibration calibration_correction.launch.py"
            )
        )
    ur_control = PathJoinSubstitution([FindPackageShare("ur_robot_driver"), "launch", "ur_control.launch.py"])
    return [
        *actions,
        IncludeLaunchDescription(PythonLaunchDescriptionSource(ur_control), launch_arguments=arguments.items()),
    ]
