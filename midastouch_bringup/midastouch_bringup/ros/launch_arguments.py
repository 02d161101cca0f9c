"""The arguments of the launch files and of `midastouch run`, and the node parameters that they stand for.

Every argument is described once, in `ARGUMENTS`, and means the same wherever it is taken. An argument that stands for
a parameter changes it only when it is given; empty leaves what the parameter file says.

`ros2 launch` imports this module into the Python of ROS, which need not have what the nodes' Python has: it, and what
it imports, keeps to the standard library and to what launch itself brings along.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

from midastouch_common.errors import InputError
from midastouch_filter.core.presets import PRESETS, PRESETS_IN_WORDS
from midastouch_perception.objects import bundled_objects

from ..output_paths import codebook_path, quick_codebook
from ..processes.parameter_files import merged, read_parameters

SHARE = Path(get_package_share_directory("midastouch_bringup"))
_YES_NO = ("true", "false")
# all that ur_control.launch.py of the UR driver takes
_UR_TYPES = (
    *("ur3", "ur5", "ur10"),
    *("ur3e", "ur5e", "ur7e", "ur10e", "ur12e", "ur16e"),
    *("ur8long", "ur15", "ur18", "ur20", "ur30"),
)
_STREAM_NODES = ("digit_sim", "tdn", "tcn", "particle_filter")


@dataclass(frozen=True)
class Argument:
    """An argument. `sets` names the parameters (node, parameter) it stands for, `kind` their type.

    `launch_only`: it is about something that only `ros2 launch` starts.
    """

    description: str
    default: str = ""
    choices: tuple[str, ...] = ()
    sets: tuple[tuple[str, str], ...] = ()
    kind: type = str
    launch_only: bool = False


ARGUMENTS = {
    # of every launch file
    "namespace": Argument("Namespace of all nodes; one per sensor, e.g. digit_left"),
    "params_file": Argument("Parameters of all nodes", str(SHARE / "config" / "midastouch.yaml")),
    "setup_file": Argument("What this launch file itself changes in params_file"),
    "params_overlay": Argument("Parameter file of yours laid over both; may hold only what differs"),
    "use_sim_time": Argument("Take the time from /clock", "false", _YES_NO),
    "use_respawn": Argument("Start a node again after it died", "false", _YES_NO),
    "log_level": Argument("What the nodes log", "info", ("debug", "info", "warn", "error", "fatal")),
    "autostart": Argument(
        "Configure and activate the lifecycle nodes without a manager; empty: as in params_file",
        choices=("", "true", "false"),
        sets=tuple((node, "autostart") for node in ("digit_driver", "digit_sim", "tdn", "tcn", "particle_filter")),
        kind=bool,
    ),
    # sensor
    "serial": Argument(
        "Serial number of the DIGIT; empty: the only one, whose captured background is not kept",
        sets=(("digit_driver", "serial"), ("tdn", "serial")),
    ),
    "sensor_model": Argument(
        "Kind of the sensor: digit_real, digit_tacto (simulated), gelsight_mini, or a YAML file; empty: as in the "
        "parameter files",
        sets=tuple((node, "sensor_model") for node in (*_STREAM_NODES, "explorer")),
    ),
    # perception and filter
    "background": Argument(
        "No-contact image of this sensor, or a folder of its images; empty: from the first images, or from bag",
        sets=(("tdn", "background"),),
    ),
    "composed": Argument("Run perception and filter in one process", "false", _YES_NO),
    "object": Argument(
        "Name of a bundled object: gives mesh, and codebook from out/codebooks (midastouch build-codebook)"
    ),
    "mesh": Argument(
        "Mesh of the object, metres: a path or package://...",
        sets=(("particle_filter", "mesh"), ("digit_sim", "mesh"), ("explorer", "mesh")),
    ),
    "codebook": Argument(
        "Codebook of that mesh; empty: a coarse one is built", sets=(("particle_filter", "codebook"),)
    ),
    "objects": Argument(
        "In place of object, where nobody knows which one it is: names of bundled objects, codebooks, folders of "
        "codebooks and meshes, separated by ','; an exploration adds the object that is touched",
    ),
    "init_mode": Argument(
        "Start: over the whole surface, at initial_pose, or once a pose is given",
        choices=("", "uniform", "pose", "wait"),
        sets=(("particle_filter", "init_mode"),),
    ),
    "preset": Argument(
        f"Filter settings between run time and error ({PRESETS_IN_WORDS}); those in a parameter file go over them",
        choices=("", *PRESETS),
        sets=(("particle_filter", "preset"),),
    ),
    "fingers": Argument(
        "Further sensors on the same object, NAMESPACE:GEL_FRAME separated by ',', e.g. /right:right_digit_gel_frame",
        sets=(("particle_filter", "fingers"),),
    ),
    "seed": Argument(
        "Seed of the filter; in an exploration also of sensor and finger",
        sets=(("particle_filter", "seed"), ("digit_sim", "seed"), ("explorer", "seed")),
        kind=int,
    ),
    # arm
    "arm": Argument(
        "Where TF of the arm comes from: already running, the UR ROS driver started here, or ur_tf over RTDE",
        "running",
        ("running", "ur_driver", "rtde"),
    ),
    "robot_ip": Argument(
        "Address of the arm; must be given with arm:=ur_driver and arm:=rtde", sets=(("ur_tf", "robot_ip"),)
    ),
    "ur_type": Argument(
        "Model of the arm, for arm:=ur_driver",
        "ur5e",
        _UR_TYPES,
        launch_only=True,
    ),
    "kinematics_params_file": Argument(
        "Calibration of this very arm (ur_calibration), for arm:=ur_driver; without it the tool may be centimetres off",
        launch_only=True,
    ),
    "use_mock_hardware": Argument("Mock arm, for arm:=ur_driver", "false", _YES_NO, launch_only=True),
    "tf_prefix": Argument(
        "Put before the arm's frames and joints, as in the UR driver",
        sets=(("ur_tf", "tf_prefix"), ("mount_tf", "tf_prefix")),
    ),
    # mount
    "frames_file": Argument(
        "Hand-eye calibration and mount",
        str(SHARE / "config" / "frames.yaml"),
        sets=(("mount_tf", "frames_file"),),
    ),
    "sensor_prefix": Argument(
        "Put before the sensor's frames; for several sensors, e.g. left_", sets=(("mount_tf", "sensor_prefix"),)
    ),
    "tool_frame": Argument(
        "Frame the sensor is mounted on, tool0 or tool0_controller; empty: as in frames_file",
        sets=(("mount_tf", "tool_frame"),),
    ),
    # recording
    "bag": Argument("YCB-Slide sequence folder, or bag (.mcap file or rosbag2 folder)", sets=(("replay", "source"),)),
    "rate": Argument(
        "Recorded seconds per second; 0: as fast as the filter follows",
        sets=(("replay", "rate"),),
        kind=float,
    ),
    "loop": Argument("Play again and again", "false", _YES_NO, (("replay", "loop"),), bool),
    # view
    "use_rviz": Argument("Start RViz", "true", _YES_NO, launch_only=True),
    "rviz_config": Argument("RViz configuration", str(SHARE / "rviz" / "midastouch.rviz"), launch_only=True),
}


def parameters(given: Mapping[str, str]) -> dict[str, dict]:
    """Parameters by node: params_file, setup_file over it, then params_overlay, and the arguments over all.

    given: values by name, of all arguments that the set-up takes. Raises InputError for a value that means nothing,
    for a file whose sensor is another than the argument's, and for an arm without its address.
    """
    paths = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given.get(name)]
    files = [_read(path) for path in paths]
    for path, nodes in zip(paths, files, strict=True):
        _require_same_sensor(path, nodes, given.get("sensor_model"))
    overrides: dict[str, dict] = {}
    for name, argument in ARGUMENTS.items():
        if given.get(name):
            value = _converted(name, given[name])
            for node, parameter in argument.sets:
                overrides.setdefault(node, {})[parameter] = value
    for node in _STREAM_NODES:
        overrides.setdefault(node, {})["use_sim_time"] = given.get("use_sim_time") == "true"
    if given.get("object"):
        found = overrides["particle_filter"]
        found.setdefault("mesh", bundled_mesh(given["object"]))
        found.setdefault("codebook", str(codebook_path(given["object"], given.get("sensor_model", "")).resolve()))
        for node in ("digit_sim", "explorer"):
            overrides.setdefault(node, {}).setdefault("mesh", bundled_mesh(given["object"]))
    if given.get("objects"):
        objects = ",".join(_named(name, given.get("sensor_model", "")) for name in given["objects"].split(","))
        # what else names an object then is the one that digit_sim simulates
        overrides["particle_filter"] |= {"objects": objects, "mesh": "", "codebook": ""}
    if given.get("bag") and not given.get("background"):
        overrides["tdn"] |= _background_of(Path(given["bag"]))
    if given.get("tf_prefix"):
        for node in ("particle_filter", "explorer"):
            overrides.setdefault(node, {})["base_frame_id"] = f"{given['tf_prefix']}base_link"
    if prefix := given.get("sensor_prefix"):
        for node in ("digit_driver", "digit_sim"):
            overrides.setdefault(node, {})["frame_id"] = f"{prefix}digit_optical_frame"
        for node in ("digit_sim", "tdn", "particle_filter", "explorer"):
            overrides.setdefault(node, {})["sensor_frame_id"] = f"{prefix}digit_gel_frame"
    nodes = merged([*files, overrides])
    _require_address(given, nodes.get("ur_tf", {}).get("robot_ip"))
    return nodes


def bundled_mesh(name: str) -> str:
    """Path of a bundled object's mesh. Raises InputError when there is none of that name."""
    objects = bundled_objects()
    if name not in objects:
        raise InputError(
            f"object:={name}: not bundled; there are {', '.join(objects)}; for another give mesh:= and codebook:="
        )
    return str(objects[name])


def _named(one: str, sensor: str) -> str:
    """One of `objects`: of a bundled object the codebook for that sensor, as long as there is none its mesh."""
    name = one.strip()
    if name not in bundled_objects():
        return name
    codebook = codebook_path(name, sensor).resolve()
    return str(codebook) if codebook.is_file() else bundled_mesh(name)


def explored(given: Mapping[str, str]) -> dict[str, str]:
    """Mesh and codebook of the object of an exploration: what is given, else those of the bundled object; and the
    `objects` that it may be for the filter, itself among them, empty if there is no other."""
    mesh = given["mesh"] or bundled_mesh(given["object"])
    codebook = given["codebook"] or _quick(Path(mesh).stem)
    names = [name.strip() for name in given["objects"].split(",")]
    others = [name for name in names if name and name != Path(mesh).stem]
    books = [_quick(name) if name in bundled_objects() else name for name in others]
    return {"mesh": mesh, "codebook": codebook, "objects": ",".join([*books, codebook]) if books else ""}


def quick_codebooks(given: Mapping[str, str]) -> dict[str, str]:
    """Meshes by the paths of the codebooks of an exploration that are built where they are missing."""
    what = explored(given)
    meshes = {_quick(name): str(path) for name, path in bundled_objects().items()}
    books = {path: meshes[path] for path in what["objects"].split(",") if path in meshes}
    return books if given["codebook"] else {**books, what["codebook"]: what["mesh"]}


def _quick(name: str) -> str:
    return str(quick_codebook(name).resolve())


def _require_address(given: Mapping[str, str], of_ur_tf: str | None) -> None:
    """InputError for an arm that is to be reached at no address; `of_ur_tf`: what ur_tf gets."""
    arm = given.get("arm")
    mock = given.get("use_mock_hardware") == "true"
    if (arm == "rtde" and not of_ur_tf) or (arm == "ur_driver" and not given["robot_ip"] and not mock):
        raise InputError(f"arm:={arm}: at which address? Give that of the arm's controller, robot_ip:=ADDRESS")


def _read(path: str) -> dict[str, dict]:
    """A parameter file. InputError for a node's name that is nearly one of ours: nobody would read its parameters."""
    ours = {node for argument in ARGUMENTS.values() for node, _ in argument.sets}.union(_STREAM_NODES)
    nodes = read_parameters(path)
    for node in nodes.keys() - ours:
        if meant := difflib.get_close_matches(node, ours, n=1, cutoff=0.75):
            raise InputError(f"{path}: no node '{node}'; did you mean {meant[0]}?")
    return nodes


def _require_same_sensor(path: str, nodes: Mapping[str, dict], sensor: str | None) -> None:
    """InputError if a parameter file has another sensor than the argument, whose default some set-ups have."""
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
    if text not in _YES_NO:
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
    """Where a sequence folder holds the sensor's no-contact image, else the images to estimate it from."""
    for inside in ("background.png", "tactile_images", "frames"):
        if (recording / inside).exists():
            return {"background": str((recording / inside).resolve())}
    return {}
