"""Set-ups without `ros2 launch`: their arguments checked, their nodes started and watched."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from midastouch_bringup.parameter_files import written
from midastouch_bringup.ros.launch_arguments import ARGUMENTS
from midastouch_bringup.ros.launch_parameters import (
    bundled_mesh,
    explored,
    named_files,
    object_to_come,
    parameters,
    quick_codebooks,
)
from midastouch_bringup.ros.setups import SETUPS, executables
from midastouch_common.errors import InputError
from midastouch_common.files import whole_folder
from midastouch_common.frames import BASE_FRAME, GEL_FRAME
from midastouch_common.output_paths import demo_slide, exploration

from ..processes.foreground import interrupted_by_signals, run_in_foreground
from ..processes.local_domain import own_domain
from ..processes.process import Program, node_program
from ..processes.supervisor import BackOff
from ..replay.source import ReplaySource


@interrupted_by_signals()
def run_setup(name: str, words: Sequence[str]) -> int:
    """Start the nodes of a set-up and watch them until they have ended or a signal comes; returns the exit status.

    words: arguments as `ros2 launch` takes them.
    Raises InputError for invalid arguments and for nodes that are not installed.
    """
    given = values(name, words)
    environment = dict(os.environ)
    _programs(name, given, Path())  # names nodes that are not installed before minutes of work
    prepare(name, given)
    if name == "explore":
        return _explore(given)
    for words in _no_pose_without(parameters(given), given):
        print(f"[midastouch] WARNING: {words}", flush=True)
    if name == "demo":
        given["bag"] = str(demo_slide(given["object"]))
        # hides the demo's nodes from the rest of the network, unless the user has chosen otherwise
        environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with tempfile.TemporaryDirectory(prefix="midastouch_") as folder:
        path, nodes = Path(folder) / "parameters.yaml", parameters(given)
        path.write_text(written(nodes, given["namespace"]))
        respawn = BackOff if given["use_respawn"] == "true" else None
        return run_in_foreground(_programs(name, given, path), environment, respawn)


def _no_pose_without(nodes: Mapping[str, Mapping], given: Mapping[str, str]) -> list[str]:
    """Return in words what a set-up with the filter lacks to give poses, each with its fix. Raises InputError for a
    recording that cannot be played."""
    lacks = [object_to_come(nodes)] if "codebook" in given else []  # only set-ups that start the filter take one
    if given.get("bag"):
        frames = {"base_frame_id": BASE_FRAME, "sensor_frame_id": GEL_FRAME, **nodes.get("particle_filter", {})}
        lacks.append(ReplaySource(given["bag"]).pose_missing(frames["base_frame_id"], frames["sensor_frame_id"]))
    return list(filter(None, lacks))


def _explore(given: dict[str, str]) -> int:
    """Run the exploration: recorded, with keys for a person, and with a page."""
    from .explore import RECORDING, run_exploration

    given |= explored(given)
    out = exploration()
    with whole_folder(out) as fresh:
        path = fresh / "parameters.yaml"
        path.write_text(written(parameters(given), ""))
        status = run_exploration(_programs("explore", given, path), given, fresh, own_domain())
    print(f"pictures and table: {out / 'index.html'}\nrecording: {out / RECORDING}")
    return status


def prepare(name: str, given: Mapping[str, str]) -> None:
    """Make the files that a set-up still lacks in the current folder; only `demo` and `explore` need any.

    Raises InputError before anything is made: for invalid values, as `parameters`, and for named files that do not
    exist.
    """
    parameters(given)
    if given.get("arm") == "mujoco":
        from midastouch_simulation.mujoco_arm import require_mujoco

        require_mujoco()
    # imported here: `--show-args`, and set-ups without files, do not need the libraries behind it
    if named := named_files(given):
        from ..demo.preparation import require_there

        require_there(named)
    if name == "demo":
        from ..demo.preparation import prepare_slide

        prepare_slide(given["object"], bundled_mesh(given["object"]))
    elif name == "explore":
        from ..demo.preparation import prepare_codebooks

        prepare_codebooks(quick_codebooks(given))


def values(setup: str, words: Sequence[str]) -> dict[str, str]:
    """Return the values of all arguments of a set-up: `words`, NAME:=VALUE each, over the defaults.

    Raises InputError for an unknown set-up, and for arguments and values that it does not take.
    """
    given = _defaults(setup)
    for word in words:
        name, separator, value = word.partition(":=")
        if not separator:
            raise InputError(f"{word}: write NAME:=VALUE")
        if name not in given:
            raise InputError(f"{name}: {setup} takes no such argument; see midastouch run {setup} --show-args")
        argument = ARGUMENTS[name]
        if argument.launch_only:
            raise InputError(f"{name}: only ros2 launch starts what this is about")
        allowed = SETUPS[setup].allowed(name)
        if allowed and value not in allowed:
            raise InputError(f"{word}: must be one of {_choices(allowed)}")
        given[name] = value
    if setup == "explore" and given["namespace"]:
        raise InputError("namespace: midastouch run explore draws without one; ros2 launch takes it")
    if given.get("arm") == "ur_driver":
        raise InputError("arm:=ur_driver: only ros2 launch starts it; start it yourself (arm:=running), or arm:=rtde")
    return given


def manual(setup: str) -> str:
    """Return the help on the arguments of a set-up. Raises InputError for an unknown set-up."""
    defaults = _defaults(setup)
    lines = [f"{setup}: {SETUPS[setup].summary}"]
    for name, default in defaults.items():
        argument = ARGUMENTS[name]
        if not argument.launch_only:
            allowed = SETUPS[setup].allowed(name)
            choices = f". One of: {_choices(allowed)}" if allowed else ""
            lines.append(f"  {name}:={default}\n      {argument.description}{choices}")
    return "\n".join(lines)


def _defaults(setup: str) -> dict[str, str]:
    if setup not in SETUPS:
        raise InputError(f"{setup}: nothing of that name can be started; there are {', '.join(SETUPS)}")
    return SETUPS[setup].values()


def _choices(choices: Sequence[str]) -> str:
    return ", ".join(choice or "''" for choice in choices)


def _programs(setup: str, given: Mapping[str, str], parameter_file: Path) -> list[Program]:
    options = ["--log-level", given["log_level"]]
    if namespace := given["namespace"].strip("/"):
        options += ["-r", f"__ns:=/{namespace}"]
    return [node_program(one.name, parameter_file, options, one.ends) for one in executables(setup, given)]
