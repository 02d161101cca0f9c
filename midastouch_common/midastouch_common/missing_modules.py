"""Advice for an import that finds no module: the distribution that has it, and the command that installs it."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

DISTRIBUTIONS = {
    "igl": "libigl",
    "mcap": "mcap",
    "onnxruntime": "onnxruntime",
    "pykdtree": "pykdtree",
    "rosbags": "rosbags",
    "simplejpeg": "simplejpeg",
    "trimesh": "trimesh",
}
"""Distribution on PyPI by module, for modules that neither Ubuntu nor ROS has a package of, to depend on."""
EXTRAS = {
    "cluster": ("distributed",),
    "export": ("h5py", "pyarrow"),
    "mujoco": ("mujoco",),
    "open3d": ("libusb-package", "open3d-cpu"),
    "train": ("onnx", "onnxscript", "safetensors", "torch"),
    "view": ("rerun-sdk",),
}
"""Distributions on PyPI that few users need, by the name of the extra."""
CLONE = Path(__file__).resolve().parents[2]
"""Root of the repository, if this code runs in a clone."""
_OF_ROS = re.compile(
    r"(rclpy|ament_index_python|launch|launch_\w+|\w+_(msgs|srvs|interfaces)|midastouch_\w+\.(nodes|ros))(\..*)?"
)


def pip_install(*arguments: str) -> str:
    """Return the command that makes the pip of this Python install its arguments."""
    return shlex.join([sys.executable, "-m", "pip", "install", *arguments])


def install_extra(name: str) -> str:
    """Return the command that installs one of `EXTRAS`; in a clone of the repository, in tested versions."""
    requirements = CLONE / "tools" / "requirements" / f"{name}.txt"
    return pip_install(*(["-r", str(requirements)] if requirements.is_file() else EXTRAS[name]))


def how_to_install(error: ImportError) -> str:
    """Return one line that names the missing module and the command that installs it or finds out more."""
    name = error.name or ""
    if name in DISTRIBUTIONS:
        return f"there is no module {name}; install it: {pip_install(DISTRIBUTIONS[name])}"
    if _OF_ROS.fullmatch(name):
        return (
            f"this needs ROS 2, and there is no module {name}; source a ROS 2 and its workspace, or run make in a clone"
        )
    return f"{error}; run midastouch doctor to see what is missing"
