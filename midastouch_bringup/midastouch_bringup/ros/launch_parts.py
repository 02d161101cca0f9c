"""Launch descriptions from the table of set-ups."""

from __future__ import annotations

from pathlib import Path

import launch.logging
from launch import LaunchContext, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EqualsSubstitution, LaunchConfiguration
from launch_ros.actions import Node

from ..parameter_files import written
from .launch_arguments import ARGUMENTS, SHARE, parameters
from .setups import SETUPS, Executable, Include


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


def start(setup: str, **arguments: str) -> list[LaunchDescriptionEntity]:
    """Everything that a set-up starts; its includes get the arguments of the including one, `arguments` over them."""
    return [
        include(part, **arguments) if isinstance(part, Include) else _processes(part) for part in SETUPS[setup].parts
    ]


def include(part: Include, **arguments: str) -> IncludeLaunchDescription:
    """The launch file of another set-up."""
    source = PythonLaunchDescriptionSource(str(SHARE / "launch" / f"{part.setup}.launch.py"))
    return IncludeLaunchDescription(source, condition=when(part.when), launch_arguments=arguments.items())


def when(condition: tuple[str, str] | None) -> IfCondition | None:
    """That an argument has a value; None stands for always."""
    return condition and IfCondition(EqualsSubstitution(LaunchConfiguration(condition[0]), condition[1]))


def in_turn(processes: list[ExecuteProcess], then: LaunchDescriptionEntity) -> list[LaunchDescriptionEntity]:
    """Run the processes one after the other, then do `then`; end the launch if one of them fails."""
    if not processes:
        return [then]
    handlers = []
    for process, following in zip(processes, [*processes[1:], then], strict=True):

        def go_on(event, _context, following=following):
            return following if event.returncode == 0 else Shutdown(reason=f"{event.process_name} failed")

        handlers.append(RegisterEventHandler(OnProcessExit(target_action=process, on_exit=go_on)))
    return [*handlers, processes[0]]


def _processes(executable: Executable) -> OpaqueFunction:
    """A process of ours, in the namespace, with the merged parameters."""

    def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
        given = context.launch_configurations
        name = "_".join([*filter(None, given["namespace"].split("/")), executable.name])
        path = Path(launch.logging.launch_config.get_log_file_path(f"{name}.yaml"))
        path.write_text(written(parameters(given), given["namespace"]))
        return [
            Node(
                package=executable.package,
                executable=executable.name,
                namespace=given["namespace"],
                parameters=[str(path)],
                arguments=["--ros-args", "--log-level", given["log_level"]],
                respawn=given["use_respawn"] == "true" and not executable.ends,
                respawn_delay=2.0,
                output="screen",
            )
        ]

    return OpaqueFunction(function=nodes, condition=when(executable.when))
