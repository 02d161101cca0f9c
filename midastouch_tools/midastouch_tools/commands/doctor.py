"""`midastouch doctor`: what is installed, what is missing, which command fixes it."""

from __future__ import annotations

import argparse
import importlib

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import CLONE, install_extra, pip_install

from . import arguments
from .plugins import BrokenCommand, commands_of_others, problem_of

_CLONED = (CLONE / "Makefile").is_file()
_SET_UP = "make setup" if _CLONED else "make setup, in a clone of the repository"
_OPEN3D = f"{install_extra('open3d')}; sudo apt install libgl1 libegl1 libx11-6"

# module, distribution, what it is for
_LIBRARIES = (
    ("numpy", "numpy", "arrays"),
    ("scipy", "scipy", "rotations, search"),
    ("cv2", "opencv-contrib-python-headless", "images, cameras"),
    ("trimesh", "trimesh", "mesh files"),
    ("pykdtree", "pykdtree", "nearest neighbours"),
    ("simplejpeg", "simplejpeg", "images in JPEG"),
    ("igl", "libigl", "nearest surface points"),
    ("onnxruntime", "onnxruntime", "networks"),
    ("matplotlib", "matplotlib", "plots"),
    ("PIL", "pillow", "pictures"),
    ("yaml", "PyYAML", "parameters"),
    ("tqdm", "tqdm", "progress"),
    ("rosbags", "rosbags", "bags"),
    ("mcap", "mcap", "bags"),
)
# the same, required, the command that fixes it
MODULES = (
    *((*library, True, _SET_UP if _CLONED else pip_install(library[1])) for library in _LIBRARIES),
    ("rclpy", "ros-rclpy", "ROS 2 nodes", True, f"{_SET_UP}, or source a ROS 2"),
    ("midastouch_msgs.msg", "midastouch_msgs", "our messages", True, f"{_SET_UP}, or colcon build"),
    ("tf2_msgs.msg", "tf2_msgs", "transforms", True, f"{_SET_UP}, or source a ROS 2"),
    ("tf2_ros", "tf2_ros", "look-ups of transforms", True, f"{_SET_UP}, or source a ROS 2"),
    ("midastouch_kernels", "midastouch_kernels", "compiled inner loops", True, f"{_SET_UP}, or colcon build"),
    ("midastouch_perception", "midastouch_perception", "image to code", True, _SET_UP),
    ("midastouch_filter", "midastouch_filter", "the filter", True, _SET_UP),
    ("midastouch_motion", "midastouch_motion", "an arm that touches", True, _SET_UP),
    ("digit_driver", "digit_driver", "the camera", True, _SET_UP),
    ("torch", "torch", "training, CUDA", False, install_extra("train")),
    ("rerun", "rerun-sdk", "midastouch view", False, install_extra("view")),
    ("mujoco", "mujoco", "an arm in MuJoCo", False, install_extra("mujoco")),
    ("pyarrow", "pyarrow", "midastouch export --format lerobot", False, install_extra("export")),
    ("h5py", "h5py", "midastouch export --format hdf5", False, install_extra("export")),
    ("midastouch_tools.view.open3d_library", "open3d-cpu", "midastouch view --export", False, _OPEN3D),
)
_PROGRAMS = ("digit_driver", "tdn", "tcn", "particle_filter", "replay", "all_in_one")


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    arguments.add_command(
        subparsers,
        "doctor",
        run,
        "say what is installed, what is missing, and which command fixes it",
        "midastouch doctor",
        "Exits with 1 when something is missing that the demo needs.",
    )


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..machine import machine_info, ros_distribution
    from ..processes.process import find_executable
    from ..text_table import text_table

    info = machine_info()
    print(f"{info['cpu']}, {info['cores']} cores, {info['memory_gib']} GiB, {info['system']}")
    print(f"Python {info['python']}")
    print(ros_distribution() or "no ROS 2", end="\n\n")
    rows, fixes = [], []
    for module, distribution, purpose, required, fix in MODULES:
        version, problem = _module_state(module, distribution)
        rows.append([distribution, purpose, version if not problem else _missing(required)])
        if problem:
            fixes.append((distribution, problem, fix, required))
    for program in _PROGRAMS:
        try:
            find_executable(program)
            rows.append([program, "executable", "found"])
        except InputError as error:
            rows.append([program, "executable", _missing(True)])
            fixes.append((program, str(error), _SET_UP, True))
    rows.append(_network_row(fixes))
    for command in commands_of_others():
        if isinstance(command, BrokenCommand):
            rows.append([f"midastouch {command.name}", "command of another package", "BROKEN"])
            fixes.append((f"midastouch {command.name}", command.problem, _SET_UP, False))
    print(text_table(["part", "for", "state"], rows, left=2))
    for name, problem, fix, required in fixes:
        print(f"\n{name}: {problem}\n  {'fix' if required else 'if wanted'}: {fix}")
    broken = any(required for *_, required in fixes)
    print("\nsomething the demo needs is missing" if broken else "\nready: midastouch demo")
    return int(broken)


def _missing(required: bool) -> str:
    return "MISSING" if required else "absent"


def _module_state(module: str, distribution: str) -> tuple[str, str]:
    """Return the version and an empty problem, or an empty version and the problem."""
    from ..machine import package_version

    try:
        imported = importlib.import_module(module)
    except Exception as error:  # a broken install can fail in any way while it is imported
        return "", problem_of(error)
    return package_version(distribution) or getattr(imported, "__version__", "found"), ""


def _network_row(fixes: list) -> list[str]:
    """Return the row of the shipped networks; add a fix to `fixes` if they do not load."""
    try:
        from midastouch_perception.tcn import load_tcn
        from midastouch_perception.tdn import load_tdn

        networks = f"{load_tdn('fast').network_id}, {load_tcn('fast').network_id}"
        return ["weights", "shipped networks", networks]
    except Exception as error:  # as above: any failure to load them is the finding
        fixes.append(("weights", problem_of(error), "git checkout -- midastouch_perception", True))
        return ["weights", "shipped networks", _missing(True)]
