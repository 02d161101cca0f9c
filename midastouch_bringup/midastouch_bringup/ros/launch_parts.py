"""Launch descriptions from the table of set-ups.

What may fail is tried before anything is started: when an action raises, launch forgets the processes that the same
description has begun, ends, and leaves them running.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import launch.logging
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchContext, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    LogInfo,
    OpaqueFunction,
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

from midastouch_common.errors import InputError

from ..processes.parameter_files import written
from ..processes.process import bound_to_us
from .launch_arguments import ARGUMENTS, SHARE, parameters
from .setups import SETUPS, Executable, Include

# one node each, under the executable's name; all_in_one has several
_LIFECYCLE_NODES = ("digit_driver", "digit_sim", "tdn", "tcn", "particle_filter")
# what a launch file starts that is not ours: its package, and how to do without
_OTHERS = {
    "mount": ("robot_state_publisher", "or publish TF of the mount yourself"),
    "rviz": ("rviz2", "or set use_rviz:=false"),
}


def on_this_machine() -> SetEnvironmentVariable:
    """Nobody else on the network sees the nodes, unless the user has said so."""
    reach = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    return SetEnvironmentVariable(reach, EnvironmentVariable(reach, default_value="LOCALHOST"))


def declare(setup: str) -> list[DeclareLaunchArgument]:
    """Declarations of the arguments of a set-up."""
    return [
        DeclareLaunchArgument(
            name,
            default_value=default,
            description=ARGUMENTS[name].description,
            choices=list(ARGUMENTS[name].choices) or None,
        )
        for name, default in SETUPS[setup].values().items()
    ]


def check(setup: str) -> OpaqueFunction:
    """Raises InputError for arguments that mean nothing, and for what is to be started and is not installed."""

    def look(context: LaunchContext) -> None:
        given = context.launch_configurations
        parameters(given)
        for part in _parts(setup, given):
            if part in _OTHERS:
                require_package(*_OTHERS[part])
            if part == "mount":
                mount_description().perform(context)

    return OpaqueFunction(function=look)


def require_package(package: str, instead: str) -> None:
    """InputError with the mend, or what to do `instead`, for a package of ROS that is not installed."""
    try:
        get_package_prefix(package)
    except PackageNotFoundError as error:
        debian = package.replace("_", "-")
        raise InputError(f"{package} is not installed: sudo apt install ros-$ROS_DISTRO-{debian}, {instead}") from error


def start(setup: str, **arguments: str) -> list[LaunchDescriptionEntity]:
    """Everything that a set-up starts; its includes get the arguments of the including one, `arguments` over them."""
    return [
        include(part, **arguments) if isinstance(part, Include) else _processes(part) for part in SETUPS[setup].parts
    ]


def start_prepared(setup: str, made: Callable[[Mapping[str, str]], Mapping[str, str]]) -> OpaqueFunction:
    """As `start`, once `midastouch run SETUP --prepare` has made what is missing; `made` names it as arguments."""

    def prepare_and_start(context: LaunchContext) -> list[LaunchDescriptionEntity]:
        given, failed = context.launch_configurations, ends_the_launch()
        about = [f"{name}:={given[name]}" for name in ("object", "mesh", "codebook", "objects") if given.get(name)]

        def go_on(event: ProcessExited, context: LaunchContext) -> object:
            # a lifecycle node that is launched once the shutdown has begun keeps launch from ending
            if event.returncode != 0 or context.is_shutdown:
                return failed(event, context)
            return start(setup, **made(given))

        # a process of its own: the libraries for it may be missing in the Python of launch
        midastouch = ExecutableInPackage("midastouch", "midastouch_bringup")
        return [ExecuteProcess(cmd=[midastouch, "run", setup, *about, "--prepare"], output="screen", on_exit=go_on)]

    return OpaqueFunction(function=prepare_and_start)


def include(part: Include, **arguments: str) -> IncludeLaunchDescription:
    """The launch file of another set-up."""
    source = PythonLaunchDescriptionSource(str(SHARE / "launch" / f"{part.setup}.launch.py"))
    return IncludeLaunchDescription(source, condition=when(part.when), launch_arguments=arguments.items())


def when(condition: tuple[str, str] | None) -> IfCondition | None:
    """That an argument has a value; None stands for always."""
    return condition and IfCondition(EqualsSubstitution(LaunchConfiguration(condition[0]), condition[1]))


def mount_description() -> Command:
    """The URDF of the mount: what xacro makes of it with the arguments of the set-up."""
    xacro = ["xacro ", str(SHARE / "urdf" / "digit_mount.urdf.xacro")]
    # to xacro a relative file is one beside its own
    frames_file = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration("frames_file")])
    for argument, value in (
        ("frames_file", frames_file),
        ("tool_frame", LaunchConfiguration("tool_frame")),
        ("tf_prefix", LaunchConfiguration("tf_prefix")),
        ("prefix", LaunchConfiguration("sensor_prefix")),
    ):
        xacro += [f" {argument}:=", value]
    return Command(xacro)


def bound_to_launch() -> list[str | LaunchConfiguration]:
    """`prefix` of a process that ends with a launch that is killed, which cannot end it."""
    # then what launch would take by itself (a debugger)
    return [f"{shlex.join(bound_to_us([]))} ", LaunchConfiguration("launch-prefix", default="")]


def ends_the_launch(*, unless_done: bool = False) -> Callable:
    """`on_exit` of a process without which the others are of no use, for as long as it is not started again.

    unless_done: of one that ends by itself; when it has done its work, the others go on. The error makes launch stop
    all processes and exit with 1, where an event of type Shutdown would let it exit with 0.
    """

    def on_exit(event: ProcessExited, context: LaunchContext) -> LogInfo | None:
        if context.is_shutdown:
            return None
        if unless_done and event.returncode == 0:
            return LogInfo(msg=f"{event.process_name} has finished; Ctrl-C ends the others")
        raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return on_exit


def _parts(setup: str, given: Mapping[str, str]) -> Iterator[str]:
    """A set-up and those that it includes with these arguments."""
    yield setup
    for part in SETUPS[setup].parts:
        if isinstance(part, Include) and (part.when is None or given[part.when[0]] == part.when[1]):
            yield from _parts(part.setup, given)


def _processes(executable: Executable) -> OpaqueFunction:
    """A process of ours, in the namespace, with the merged parameters."""

    def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
        given = context.launch_configurations
        name = "_".join([*filter(None, given["namespace"].split("/")), executable.name])
        path = Path(launch.logging.launch_config.get_log_file_path(f"{name}.yaml"))
        path.write_text(written(parameters(given), given["namespace"]))
        respawn = given["use_respawn"] == "true" and not executable.ends
        options = {
            "package": executable.package,
            "executable": executable.name,
            "namespace": given["namespace"],
            "parameters": [str(path)],
            "arguments": ["--ros-args", "--log-level", given["log_level"]],
            "respawn": respawn,
            "respawn_delay": 2.0,
            "on_exit": None if respawn else ends_the_launch(unless_done=executable.ends),
            "output": "screen",
            "prefix": bound_to_launch(),
        }
        if executable.name in _LIFECYCLE_NODES:
            return [LifecycleNode(name=executable.name, **options)]
        return [Node(**options)]

    return OpaqueFunction(function=nodes, condition=when(executable.when))
