"""The packages of the workspace, each after those that it may import."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CMAKE = ["midastouch_msgs", "midastouch_kernels"]
PYTHON = [
    "midastouch_common",
    "digit_driver",
    "midastouch_perception",
    "midastouch_filter",
    "midastouch_motion",
    "midastouch_bringup",
    "midastouch_simulation",
    "midastouch_tools",
    "midastouch_benchmark",
]
