"""A simulated finger or arm explores an object by itself, until the filter knows its pose. No hardware, no data.

The codebooks are made by the first run, under out/ of the present folder, and kept. `midastouch run explore` does the
same, takes keys, and ends with a page.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
    SetLaunchConfiguration,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EnvironmentVariable, EqualsSubstitution, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

from midastouch_bringup.ros.launch_parameters import explored
from midastouch_bringup.ros.launch_parts import (
    check_arguments,
    check_rviz,
    declared,
    ending_node,
    lasting_node,
    lifecycle_node,
    once_done,
)
from midastouch_bringup.ros.setups import SETUPS

SHARE = Path(get_package_share_directory("midastouch_bringup"))
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"
ARGUMENTS = declared(SETUPS["explore"].values(), SETUPS["explore"].choices)


def generate_launch_description() -> LaunchDescription:
    """Make what is missing, then `digit_sim`, the localisation, what moves the gel and `explorer`."""
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
                    "explore",
                    ["object:=", LaunchConfiguration("object")],
                    ["mesh:=", LaunchConfiguration("mesh")],
                    ["codebook:=", LaunchConfiguration("codebook")],
                    ["objects:=", LaunchConfiguration("objects")],
                    ["arm:=", LaunchConfiguration("arm")],
                    "--prepare",
                ],
                output="screen",
                on_exit=once_done(explore),
            ),
        ]
    )


def explore(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The nodes. Launch files that are included get the arguments of this one by their names."""
    return [
        # mesh, codebook and objects: those that were just made
        *(SetLaunchConfiguration(name, path) for name, path in explored(context.launch_configurations).items()),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "digit_sim.launch.py"))),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(str(SHARE / "launch" / "localization.launch.py"))),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(str(SHARE / "launch" / "rviz.launch.py")),
            condition=IfCondition(LaunchConfiguration("use_rviz")),
        ),
        _simulated_arm("midastouch_bringup", "finger", "finger"),
        _simulated_arm("midastouch_motion", "mujoco_arm", "mujoco"),
        lifecycle_node(
            "midastouch_motion", "slider", ["autostart", "tf_prefix", "sensor_prefix"], condition=_arm_is("mujoco")
        ),
        ending_node("midastouch_bringup", "explorer", ["mesh", "seed", "tf_prefix", "sensor_prefix"]),
    ]


def _arm_is(name: str) -> IfCondition:
    return IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), name))


def _simulated_arm(package: str, executable: str, name: str) -> Node:
    """What moves the gel, started for arm:=`name`."""
    return lasting_node(package, executable, ["mesh", "seed", "tf_prefix", "sensor_prefix"], condition=_arm_is(name))
