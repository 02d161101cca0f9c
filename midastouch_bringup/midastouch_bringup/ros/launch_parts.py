"""Parts of the launch files that plain launch does not have.

Checks that may fail come before anything is started: if an action raises, launch forgets the processes that the same
description has begun, ends, and leaves them running.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import launch.logging
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchContext, LaunchDescriptionEntity, Substitution
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    LogInfo,
    SetEnvironmentVariable,
)
from launch.conditions import IfCondition
from launch.events.process import ProcessExited
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import (
    Command,
    EnvironmentVariable,
    EqualsSubstitution,
    LaunchConfiguration,
    PathJoinSubstitution,
)
from launch_ros.actions import LifecycleNode, Node
from launch_ros.substitutions import ExecutableInPackage

from midastouch_common.errors import EXIT_BAD_INPUT, InputError
from midastouch_common.stop_signals import bound_to_us

from ..parameter_files import written
from .launch_arguments import ARGUMENTS, SHARE
from .launch_parameters import FILES, OWN_TIME, object_to_come, parameters


def declared(
    defaults: Mapping[str, str], choices: Mapping[str, Sequence[str]] = MappingProxyType({})
) -> list[DeclareLaunchArgument]:
    """Declare launch arguments with their names and defaults, as `Setup.values` returns them; choices: of those that
    take fewer values than in `ARGUMENTS`, which has everything else."""
    return [
        DeclareLaunchArgument(
            name,
            default_value=default,
            choices=choices.get(name, ARGUMENTS[name].choices) or None,
            description=ARGUMENTS[name].description,
        )
        for name, default in defaults.items()
    ]


class MergedParameters(Substitution):
    """Path of the parameter file of one process, which launch writes to its log folder.

    params_file comes first, over it the launch file's changes (setup_file), then params_overlay. Over all of them come
    the launch arguments named by `arguments`, if given, and a simulated `arm`; `ARGUMENTS` lists the parameters that
    each sets. A name that no launch file has declared counts as not given.
    """

    def __init__(self, process: str, arguments: Sequence[str]):
        super().__init__()
        self._process, self._names = process, {*FILES, *arguments}

    def describe(self) -> str:
        """Return the name used in messages of launch."""
        return f"MergedParameters({self._process})"

    def perform(self, context: LaunchContext) -> str:
        """Write the file; returns its path. Raises as `parameters`."""
        given = context.launch_configurations
        namespace = given["namespace"]
        name = "_".join([*filter(None, namespace.split("/")), self._process])
        path = Path(launch.logging.launch_config.get_log_file_path(f"{name}.yaml"))
        names = self._names | ({"arm"} if given.get("arm") in OWN_TIME else set())
        path.write_text(written(parameters({key: given[key] for key in names if key in given}), namespace))
        return str(path)


class UseRespawn(LaunchConfiguration):
    """The launch argument `use_respawn`, with its value from the start of the process.

    If an including launch file has put this one in a group, the argument no longer exists when a process ends.
    """

    def __init__(self):
        super().__init__("use_respawn")
        self._value = "false"

    def perform(self, context: LaunchContext) -> str:
        """Return the value, and keep it."""
        self._value = super().perform(context)
        return self._value

    def or_end_launch(self, event: ProcessExited, context: LaunchContext) -> None:
        """End the launch when a required process exits, unless launch starts it again; for `on_exit`.

        After bad input the launch ends in any case: launch would start the process again for ever.
        """
        if not context.is_shutdown and (self._value != "true" or event.returncode == EXIT_BAD_INPUT):
            raise _died(event)


def included(name: str, **options) -> IncludeLaunchDescription:
    """Include another of our launch files, which receives the arguments of the including one by name; options: of the
    action, such as a condition."""
    source = PythonLaunchDescriptionSource(str(SHARE / "launch" / f"{name}.launch.py"))
    return IncludeLaunchDescription(source, **options)


def wanted(argument: str) -> IfCondition:
    """Return the condition that the launch argument is true."""
    return IfCondition(LaunchConfiguration(argument))


def arm_is(name: str) -> IfCondition:
    """Return the condition arm:=`name`."""
    return IfCondition(EqualsSubstitution(LaunchConfiguration("arm"), name))


def lifecycle_node(package: str, executable: str, takes: Sequence[str], **options) -> LifecycleNode:
    """Make a `lasting_node` of one of our lifecycle nodes, named as its executable."""
    return LifecycleNode(name=executable, **_of_lasting(package, executable, takes), **options)


def lasting_node(package: str, executable: str, takes: Sequence[str], **options) -> Node:
    """Make a required node: if it exits and is not started again, the launch ends. takes: names of the launch arguments
    that set its parameters; options: of the action, such as a condition."""
    return Node(**_of_lasting(package, executable, takes), **options)


def ending_node(package: str, executable: str, takes: Sequence[str]) -> Node:
    """Make a node that ends by itself once its work is done; the others stay, so that you can look at them."""
    return Node(**_of_node(package, executable, takes), on_exit=end_launch_if_failed)


def _of_lasting(package: str, executable: str, takes: Sequence[str]) -> dict:
    use_respawn = UseRespawn()
    respawn = {"respawn": use_respawn, "respawn_delay": 2.0, "on_exit": use_respawn.or_end_launch}
    return _of_node(package, executable, takes) | respawn


def _of_node(package: str, executable: str, takes: Sequence[str]) -> dict:
    return {
        "package": package,
        "executable": executable,
        "namespace": LaunchConfiguration("namespace"),
        "parameters": [MergedParameters(executable, takes)],
        "arguments": ["--ros-args", "--log-level", LaunchConfiguration("log_level")],
        "output": "screen",
        **bound_to_launch(executable),
    }


def check_arguments(context: LaunchContext) -> None:
    """Raise InputError for invalid arguments."""
    parameters(context.launch_configurations)


def say_if_no_object(context: LaunchContext) -> list[LogInfo]:
    """Warn if the filter is started without an object: it would look as healthy as with one."""
    words = object_to_come(parameters(context.launch_configurations))
    return [LogInfo(msg=f"WARNING: {words}")] if words else []


def check_package(_context: LaunchContext, package: str, instead: str) -> None:
    """Raise InputError with the fix and the alternative `instead` if a package of ROS is not installed."""
    try:
        get_package_prefix(package)
    except PackageNotFoundError as error:
        debian = package.replace("_", "-")
        raise InputError(f"{package} is not installed: sudo apt install ros-$ROS_DISTRO-{debian}, {instead}") from error


def check_rviz(context: LaunchContext) -> None:
    """Raise InputError if RViz is not installed."""
    check_package(context, "rviz2", "or set use_rviz:=false")


def check_mount(context: LaunchContext) -> None:
    """Raise InputError if robot_state_publisher is not installed, and xacro's error if it cannot describe the mount."""
    check_package(context, "robot_state_publisher", "or publish TF of the mount yourself")
    mount_description().perform(context)


def mount_description() -> Command:
    """Return the URDF of the mount, expanded by xacro with the launch arguments."""
    xacro = ["xacro ", str(SHARE / "urdf" / "digit_mount.urdf.xacro")]
    # xacro resolves a relative path from the folder of its own file
    frames_file = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration("frames_file")])
    for argument, value in (
        ("frames_file", frames_file),
        ("tool_frame", LaunchConfiguration("tool_frame")),
        ("tf_prefix", LaunchConfiguration("tf_prefix")),
        ("prefix", LaunchConfiguration("sensor_prefix")),
    ):
        xacro += [f" {argument}:=", value]
    return Command(xacro)


def bound_to_launch(executable: str) -> dict[str, str | list[str | LaunchConfiguration]]:
    """Return action arguments that make a node's process end even if launch is killed and cannot end it."""
    # followed by the prefix that launch itself would use (a debugger)
    prefix = [f"{shlex.join(map(str, bound_to_us([])))} ", LaunchConfiguration("launch-prefix", default="")]
    # launch would name the process after the first word of the prefix
    return {"prefix": prefix, "exec_name": executable}


def end_launch_if_failed(event: ProcessExited, context: LaunchContext) -> LogInfo | None:
    """End the launch if a process that ends by itself has failed; otherwise the others stay; for `on_exit`."""
    if context.is_shutdown:
        return None
    if event.returncode != 0:
        raise _died(event)
    return LogInfo(msg=f"{event.process_name} has finished; Ctrl-C ends the others")


def to_ourselves() -> SetEnvironmentVariable:
    """Hide the nodes from the rest of the network, unless the user has chosen otherwise."""
    reach = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    return SetEnvironmentVariable(reach, EnvironmentVariable(reach, default_value="LOCALHOST"))


def prepared(
    setup: str, takes: Sequence[str], following: Callable[[LaunchContext], list[LaunchDescriptionEntity]]
) -> ExecuteProcess:
    """Make the files that a set-up needs, then start the actions of `following`; takes: names of launch arguments."""
    # a process of its own: the libraries for it may be missing in the Python of launch
    midastouch = ExecutableInPackage("midastouch", "midastouch_tools")
    given = [[f"{name}:=", LaunchConfiguration(name)] for name in takes]
    return ExecuteProcess(
        cmd=[midastouch, "run", setup, *given, "--prepare"], output="screen", on_exit=once_done(following)
    )


def once_done(following: Callable[[LaunchContext], list[LaunchDescriptionEntity]]) -> Callable:
    """Return an `on_exit` for a process that makes files: start `following`, or end the launch if that has failed."""

    def on_exit(event: ProcessExited, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        # a lifecycle node that is launched once the shutdown has begun keeps launch from ending
        if context.is_shutdown:
            return []
        if event.returncode != 0:
            raise _died(event)
        return following(context)

    return on_exit


def _died(event: ProcessExited) -> RuntimeError:
    """Raised in `on_exit`, it makes launch stop all processes and exit with 1; a Shutdown would let it exit with 0."""
    return RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")
