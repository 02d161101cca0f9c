"""What to say where an import finds no module: who brings it, and by which command."""

from __future__ import annotations

import re
import sys

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
_OF_ROS = re.compile(
    r"(rclpy|ament_index_python|launch|launch_\w+|\w+_(msgs|srvs|interfaces)|midastouch_\w+\.(nodes|ros))(\..*)?"
)


def how_to_install(error: ImportError) -> str:
    """One line: what the import did not find, and the command or page that brings it."""
    name = error.name or ""
    if name in DISTRIBUTIONS:
        return f"there is no module {name}; install it: {sys.executable} -m pip install {DISTRIBUTIONS[name]}"
    if _OF_ROS.fullmatch(name):
        return (
            f"this needs ROS 2, and there is no module {name}; source a ROS 2 and its workspace, or run make in a clone"
        )
    return f"{error}; run midastouch doctor to see what is missing"
