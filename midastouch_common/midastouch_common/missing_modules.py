"""What to say where an import finds no module: who brings it, and by which command."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

DISTRIBUTIONS = {
    "distributed": "distributed",
    "igl": "libigl",
    "mcap": "mcap",
    "onnxruntime": "onnxruntime",
    "pykdtree": "pykdtree",
    "rosbags": "rosbags",
    "trimesh": "trimesh",
}
"""Module: distribution on PyPI, of what neither Ubuntu nor ROS packages, so that no Debian package can depend on it."""
EXTRAS = {
    "export": ("h5py", "pyarrow"),
    "mujoco": ("mujoco",),
    "open3d": ("libusb-package", "open3d-cpu"),
    "train": ("onnx", "onnxscript", "safetensors", "torch"),
    "view": ("rerun-sdk",),
}
"""Distributions on PyPI of what few users need, by name."""
CLONE = Path(__file__).resolve().parents[2]
"""Where the repository is, if this is one."""
_OF_ROS = re.compile(
    r"(rclpy|ament_index_python|launch|launch_\w+|\w+_(msgs|srvs|interfaces)|midastouch_\w+\.(nodes|ros))(\..*)?"
)


def pip_install(*arguments: str) -> str:
    """The command that has the pip of this Python install what they name."""
    return shlex.join([sys.executable, "-m", "pip", "install", *arguments])


def install_extra(name: str) -> str:
    """The command that installs one of `EXTRAS`: of tested versions where this is a clone of the repository."""
    requirements = CLONE / "tools" / "requirements" / f"{name}.txt"
    return pip_install(*(["-r", str(requirements)] if requirements.is_file() else EXTRAS[name]))


def how_to_install(error: ImportError) -> str:
    """One line: what the import did not find, and the command or page that brings it."""
    name = error.name or ""
    if name in DISTRIBUTIONS:
        return f"there is no module {name}; install it: {pip_install(DISTRIBUTIONS[name])}"
    if _OF_ROS.fullmatch(name):
        return (
            f"this needs ROS 2, and there is no module {name}; source a ROS 2 and its workspace, or run make in a clone"
        )
    return f"{error}; run midastouch doctor to see what is missing"
