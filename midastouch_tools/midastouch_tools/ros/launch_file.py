"""Our launch files: their arguments, checked before anything is started, and their processes."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchService
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from midastouch_bringup.parameter_files import merged, read_parameters
from midastouch_common.errors import InputError
from midastouch_common.names import require_name

from ..commands import limits
from ..processes.process import Program
from .parameter_tables import TABLES

SHARE = Path(get_package_share_directory("midastouch_bringup"))
FILES = ("params_file", "setup_file", "params_overlay")
"""Arguments that name parameter files, each laid over those before it."""
_NAMES = {
    "namespace": "namespace",
    "serial": "serial number",
    **dict.fromkeys(("tool_frame", "tf_prefix", "sensor_prefix"), "frame"),
}
_NUMBERS = {"seed": limits.seed, "rate": limits.replay_rate, "pinches": limits.count}
_FORMER = {"slider": "contact_controller", "finger": "simulated_finger"}


def names() -> list[str]:
    """Return the names of our launch files."""
    return sorted(path.name.removesuffix(".launch.py") for path in (SHARE / "launch").glob("*.launch.py"))


def path_of(name: str) -> Path:
    """Return the path of one of our launch files by name, or of another by its path. InputError if there is none."""
    if name.endswith(".launch.py"):
        if not Path(name).is_file():
            raise InputError(f"{name}: no such launch file")
        return Path(name)
    if name not in names():
        raise InputError(f"{name}: nothing of that name can be started; there are {', '.join(names())}")
    return SHARE / "launch" / f"{name}.launch.py"


def declared(name: str) -> dict[str, DeclareLaunchArgument]:
    """Return the arguments of a launch file, by name, with those of the launch files that it includes."""
    description = PythonLaunchDescriptionSource(str(path_of(name))).get_launch_description(LaunchContext())
    return {argument.name: argument for argument in description.get_launch_arguments()}


def values(name: str, words: Sequence[str]) -> dict[str, str]:
    """Return the values of all arguments of a launch file: `words`, NAME:=VALUE each, over the defaults.

    Raises InputError for arguments that it does not take, values that are none of the choices, names that can be
    none, one that is missing, and parameter files that cannot be used.
    """
    arguments, given = declared(name), {}
    for word in words:
        key, separator, value = word.partition(":=")
        if not separator:
            raise InputError(f"{word}: write NAME:=VALUE")
        if key not in arguments:
            raise InputError(f"{key}: {name} takes no such argument; see midastouch run {name} --show-args")
        given[key] = value
    context = LaunchContext()
    context.launch_configurations.update(given)
    for key, argument in arguments.items():
        if key not in given and argument.default_value is None:
            raise InputError(f"{key}: must be given, {key}:=VALUE: {argument.description}")
        if key not in given:
            given[key] = "".join(context.perform_substitution(part) for part in argument.default_value)
            context.launch_configurations[key] = given[key]
        if argument.choices and given[key] not in argument.choices:
            raise InputError(f"{key}:={given[key]}: must be one of {', '.join(argument.choices)}")
        if key in _NUMBERS and given[key]:
            try:
                _NUMBERS[key](given[key])
            except argparse.ArgumentTypeError as error:
                raise InputError(f"{key}:= {error}") from None
        if key in _NAMES and given[key]:
            require_name(_NAMES[key], given[key], f"{key}:=")
    parameters(given)
    return given


def parameters(given: Mapping[str, str]) -> dict[str, dict]:
    """Return the parameters in the parameter files that are given, by node.

    Raises InputError for a file that cannot be read, or with a name that is nearly a node's: nobody would read its
    parameters; and for a file whose sensor differs from the argument's.
    """
    layers = []
    for path in filter(None, map(given.get, FILES)):
        layers.append(nodes := read_parameters(path))
        for node in nodes.keys() - TABLES.keys():
            near = difflib.get_close_matches(node, TABLES, n=1, cutoff=0.75)
            if meant := _FORMER.get(node) or "".join(near):
                raise InputError(f"{path}: no node '{node}'; did you mean {meant}?")
        for node, values_of_node in nodes.items():
            theirs, sensor = values_of_node.get("sensor_model"), given.get("sensor_model")
            if sensor and theirs not in (None, sensor):
                raise InputError(
                    f"{path}: {node} has the sensor_model {theirs}, but the argument is {sensor}; "
                    f"take it out of the file, or give sensor_model:={theirs}"
                )
    return merged(layers)


def manual(name: str) -> str:
    """Return the help on the arguments of a launch file. Raises InputError if there is none of that name."""
    lines, context = [f"{name}:"], LaunchContext()
    for key, argument in declared(name).items():
        default = argument.default_value
        text = "".join(context.perform_substitution(part) for part in default or ())
        context.launch_configurations[key] = text
        more = f". One of: {', '.join(argument.choices)}" if argument.choices else ""
        more += "; must be given" if default is None else ""
        lines.append(f"  {key}:={text}\n      {argument.description}{more}")
    return "\n".join(lines)


def carry_out(name: str, given: Mapping[str, str]) -> int:
    """Carry a launch file out, with these values of its arguments; returns the exit status."""
    service = LaunchService()
    source = PythonLaunchDescriptionSource(str(path_of(name)))
    service.include_launch_description(IncludeLaunchDescription(source, launch_arguments=given.items()))
    return service.run()


def programs(name: str, given: Mapping[str, str], folder: Path) -> list[Program]:
    """Return what a launch file starts; with ROS 2's own launch that is one program, `ros2 launch`.

    folder: for files with parameters, which are made. Raises InputError for what cannot be started.
    """
    try:
        from launch.on_wheels import commands
    except ModuleNotFoundError:
        words = [f"{key}:={value}" for key, value in given.items()]
        return [Program(name, ("ros2", "launch", str(path_of(name)), *words))]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        found = commands(path_of(name), given, folder)
    except RuntimeError as error:
        raise InputError(str(error)) from error
    return [Program(one, tuple(command), ends=one == "explorer") for one, command in found.items()]
