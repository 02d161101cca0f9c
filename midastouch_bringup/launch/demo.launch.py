"""A simulated slide over a bundled object, played like a recording. No hardware, no data to download.

Slide and codebook are made by the first run, under out/ of the present folder, and kept.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
    SetLaunchConfiguration,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.substitutions import ExecutableInPackage

from midastouch_bringup.output_paths import demo_slide
from midastouch_bringup.ros.launch_parts import check_arguments, check_rviz, once_done

SHARE = Path(get_package_share_directory("midastouch_bringup"))
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"
ARGUMENTS = [
    DeclareLaunchArgument(
        "rate", default_value="", description="Recorded seconds per second; 0: as fast as the filter follows"
    ),
    DeclareLaunchArgument("loop", default_value="true", choices=["true", "false"], description="Play again and again"),
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
        "use_sim_time", default_value="true", choices=["true", "false"], description="Take the time from /clock"
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
        "setup_file",
        default_value=str(SHARE / "config" / "replay.yaml"),
        description="What this launch file itself changes in params_file",
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
        "object",
        default_value="handle_tool",
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
        "tf_prefix", default_value="", description="Put before the arm's frames and joints, as in the UR driver"
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
    """Make what is missing, then replay.launch.py, which gets these arguments by their names."""
    return LaunchDescription(
        [
            # nobody else on the network sees the nodes, unless the user has said so
            SetEnvironmentVariable(REACH, EnvironmentVariable(REACH, default_value="LOCALHOST")),
            *ARGUMENTS,
            OpaqueFunction(function=check_arguments),
            OpaqueFunction(function=check_rviz, condition=IfCondition(LaunchConfiguration("use_rviz"))),
            # a process of its own: the libraries for it may be missing in the Python of launch
            ExecuteProcess(
                cmd=[
                    ExecutableInPackage("midastouch", "midastouch_bringup"),
                    "run",
                    "demo",
                    ["object:=", LaunchConfiguration("object")],
                    "--prepare",
                ],
                output="screen",
                on_exit=once_done(play),
            ),
        ]
    )


def play(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The replay of the slide."""
    return [
        SetLaunchConfiguration("bag", str(demo_slide(context.launch_configurations["object"]))),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "replay.launch.py"))),
    ]
