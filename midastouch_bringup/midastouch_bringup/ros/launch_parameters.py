"""The parameters of all nodes, from parameter files and launch arguments.

As `launch_arguments`, this module and its imports keep to the standard library and to the dependencies of launch.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.output_paths import codebook_path, quick_codebook
from midastouch_perception.objects import bundled_objects

from ..parameter_files import EVERY_NODE, merged, read_parameters
from .launch_arguments import ARGUMENTS, OF_FILES, SHARE, SIMULATED_ARMS, STREAM_NODES

_FORMER = {"slider": "contact_controller", "finger": "simulated_finger"}
FILES = ("params_file", "setup_file", "params_overlay")
"""Arguments that name parameter files, each laid over those before it."""
OWN_TIME = ("mujoco",)
"""Values of the argument `arm` that have their own parameter file, laid over setup_file, and their own time."""


def parameters(given: Mapping[str, str]) -> dict[str, dict]:
    """Return the parameters by node: params_file, setup_file over it, then params_overlay, and the arguments over all.

    given: values by name, of all arguments that the set-up takes. Raises InputError for an invalid value, for a file
    whose sensor differs from the argument's, and for an arm without an address.
    """
    paths = [given[name] for name in FILES if given.get(name)]
    if given.get("arm") in OWN_TIME:
        paths.insert(len(paths) - bool(given.get("params_overlay")), str(SHARE / "config" / f"arm_{given['arm']}.yaml"))
    files = [_read(path) for path in paths]
    for path, nodes in zip(paths, files, strict=True):
        _require_same_sensor(path, nodes, given.get("sensor_model"))
    overrides: dict[str, dict] = {}
    for name, argument in ARGUMENTS.items():
        if given.get(name):
            value = _converted(name, given[name])
            for node, parameter in argument.sets:
                overrides.setdefault(node, {})[parameter] = value
    of_clock = given.get("use_sim_time") == "true" or given.get("arm") in OWN_TIME
    for node in (*STREAM_NODES, *(("contact_controller", "explorer") if of_clock else ())):
        overrides.setdefault(node, {})["use_sim_time"] = of_clock
    if given.get("object"):
        found = overrides["particle_filter"]
        found.setdefault("mesh", bundled_mesh(given["object"]))
        found.setdefault("codebook", str(codebook_path(given["object"], given.get("sensor_model", "")).resolve()))
        for node in ("digit_sim", *SIMULATED_ARMS, "explorer"):
            overrides.setdefault(node, {}).setdefault("mesh", bundled_mesh(given["object"]))
    if given.get("objects"):
        objects = ",".join(_named(name, given.get("sensor_model", "")) for name in given["objects"].split(","))
        # object and mesh then name only the object that digit_sim simulates
        overrides["particle_filter"] |= {"objects": objects, "mesh": "", "codebook": ""}
    if given.get("bag") and not given.get("background"):
        overrides["tdn"] |= _background_of(Path(given["bag"]))
    if given.get("tf_prefix"):
        for node in ("particle_filter", *SIMULATED_ARMS, "contact_controller", "explorer"):
            overrides.setdefault(node, {})["base_frame_id"] = f"{given['tf_prefix']}base_link"
        overrides.setdefault("ur_speed", {})["tool_frame_id"] = f"{given['tf_prefix']}tool0"
    if prefix := given.get("sensor_prefix"):
        for node in ("digit_driver", "digit_sim"):
            overrides.setdefault(node, {})["frame_id"] = f"{prefix}digit_optical_frame"
        # for an arm with mechanics digit_sim takes the true gel frame, of the arm's own parameter file
        sees = () if given.get("arm") in OWN_TIME else ("digit_sim",)
        for node in (*sees, "tdn", "particle_filter", *SIMULATED_ARMS, "ur_speed", "contact_controller", "explorer"):
            overrides.setdefault(node, {})["sensor_frame_id"] = f"{prefix}digit_gel_frame"
    nodes = merged([*files, overrides])
    of_ur_tf = nodes.get("ur_tf", {})
    _require_address(given, of_ur_tf.get("robot_ip"))
    # the same arm: a value that a file has for ur_tf only holds for ur_speed, too
    for name in of_ur_tf.keys() & {"robot_ip", "tcp_offset"}:
        nodes.setdefault("ur_speed", {}).setdefault(name, of_ur_tf[name])
    _keep_to_box(nodes)
    return nodes


def object_to_come(nodes: Mapping[str, Mapping]) -> str:
    """Return a warning, with the fix, that the filter starts without an object; empty if it has one.

    nodes: from `parameters`.
    """
    of_filter = nodes.get("particle_filter", {})
    if any(of_filter.get(name) for name in ("mesh", "codebook", "objects")):
        return ""
    return (
        "particle_filter has no object and gives no pose: start again with object:=NAME of a bundled one, mesh:=FILE "
        "or objects:=..., or call the service set_object"
    )


def bundled_mesh(name: str) -> str:
    """Return the path of a bundled object's mesh. Raises InputError if there is none of that name."""
    objects = bundled_objects()
    if name not in objects:
        raise InputError(
            f"object:={name}: not bundled; there are {', '.join(objects)}; for another give mesh:= and codebook:="
        )
    return str(objects[name])


def _named(one: str, sensor: str) -> str:
    """Resolve one of `objects`: a bundled one to its codebook for that sensor, or to its mesh if there is none."""
    name = one.strip()
    if name not in bundled_objects():
        return name
    codebook = codebook_path(name, sensor).resolve()
    return str(codebook) if codebook.is_file() else bundled_mesh(name)


def named_files(given: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return name and value of each given argument that stands for a file or folder, those of `objects` one by one."""
    named = [(name, given[name]) for name in OF_FILES if given.get(name)]
    objects = [name.strip() for name in given.get("objects", "").split(",")]
    return named + [("objects", name) for name in objects if name and name not in bundled_objects()]


def explored(given: Mapping[str, str]) -> dict[str, str]:
    """Return mesh and codebook of the object of an exploration, as given or of the bundled object; and `objects`, the
    candidates for the filter, including the object itself, empty if there is no other."""
    mesh = given["mesh"] or bundled_mesh(given["object"])
    codebook = given["codebook"] or _quick(Path(mesh).stem)
    names = [name.strip() for name in given["objects"].split(",")]
    others = [name for name in names if name and name != Path(mesh).stem]
    books = [_quick(name) if name in bundled_objects() else name for name in others]
    return {"mesh": mesh, "codebook": codebook, "objects": ",".join([*books, codebook]) if books else ""}


def quick_codebooks(given: Mapping[str, str]) -> dict[str, str]:
    """Return the meshes, by codebook path, of the codebooks of an exploration that are built if they are missing."""
    what = explored(given)
    meshes = {_quick(name): str(path) for name, path in bundled_objects().items()}
    books = {path: meshes[path] for path in what["objects"].split(",") if path in meshes}
    return books if given["codebook"] else {**books, what["codebook"]: what["mesh"]}


def _quick(name: str) -> str:
    return str(quick_codebook(name).resolve())


def _require_address(given: Mapping[str, str], of_ur_tf: str | None) -> None:
    """Raise InputError for an arm that needs an address and has none; `of_ur_tf`: the one that ur_tf gets."""
    arm = given.get("arm")
    mock = given.get("use_mock_hardware") == "true"
    if (arm == "rtde" and not of_ur_tf) or (arm == "ur_driver" and not given["robot_ip"] and not mock):
        raise InputError(f"arm:={arm}: at which address? Give that of the arm's controller, robot_ip:=ADDRESS")


def _keep_to_box(nodes: dict[str, dict]) -> None:
    """Give an explorer without a box of its own the arm's box, and at most its tilt; InputError for an empty box."""
    arm = nodes.get("contact_controller", {})
    corners = [arm.get(f"box_{corner}") for corner in ("low", "high")]
    if None in corners:
        return
    if not all(low < high for low, high in zip(*corners, strict=True)):
        raise InputError(
            "where may the arm move? Give box_low and box_high of contact_controller, opposite corners of a box in the "
            "base frame [m], in a parameter file: params_overlay:=FILE"
        )
    explorer = nodes.setdefault("explorer", {})
    for name, corner in zip(("reach_low", "reach_high"), corners, strict=True):
        explorer.setdefault(name, corner)
    if "max_tilt" in arm:
        explorer["max_tilt"] = min(explorer.get("max_tilt", arm["max_tilt"]), arm["max_tilt"])


def _read(path: str) -> dict[str, dict]:
    """Read a parameter file; its values for every node (`/**`) become each node's, and so override earlier files.

    InputError for a node's name that is nearly one of ours: no node would read its parameters.
    """
    ours = {node for argument in ARGUMENTS.values() for node, _ in argument.sets}.union(STREAM_NODES)
    nodes = read_parameters(path)
    for node in nodes.keys() - ours:
        near = difflib.get_close_matches(node, ours, n=1, cutoff=0.75)
        if meant := _FORMER.get(node) or "".join(near):
            raise InputError(f"{path}: no node '{node}'; did you mean {meant}?")
    everywhere = nodes.get(EVERY_NODE, {})
    return merged([dict.fromkeys(ours, everywhere), nodes]) if everywhere else nodes


def _require_same_sensor(path: str, nodes: Mapping[str, dict], sensor: str | None) -> None:
    """Raise InputError if a parameter file has another sensor than the argument, given or a set-up's default."""
    for node in ("tdn", "tcn", "particle_filter"):
        theirs = nodes.get(node, {}).get("sensor_model", sensor)
        if sensor and theirs != sensor:
            raise InputError(
                f"{path}: {node} has the sensor_model {theirs}, but the argument says {sensor}; "
                f"take it out of the file, or give sensor_model:={theirs}"
            )


def _converted(name: str, text: str) -> object:
    read, expected = _KINDS[ARGUMENTS[name].kind]
    try:
        return read(text)
    except ValueError as error:
        raise InputError(f"{name}:={text}: must be {expected}") from error


def _finite(text: str) -> float:
    if not math.isfinite(number := float(text)):
        raise ValueError(text)
    return number


def _yes(text: str) -> bool:
    if text not in ("true", "false"):
        raise ValueError(text)
    return text == "true"


# how a value is read, and what it must be
_KINDS: dict[type, tuple[Callable[[str], object], str]] = {
    str: (str, "text"),
    int: (int, "a whole number"),
    float: (_finite, "a number"),
    bool: (_yes, "true or false"),
}


def _background_of(recording: Path) -> dict[str, str]:
    """Return the parameter `background`: a sequence's no-contact image or, without one, images to estimate it from."""
    for inside in ("background.png", "tactile_images", "frames"):
        if (recording / inside).exists():
            return {"background": str((recording / inside).resolve())}
    return {}
