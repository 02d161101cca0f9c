"""This machine and what is installed: the `machine` key of the JSON files, and the ROS 2 distribution."""

from __future__ import annotations

import contextlib
import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path

_PACKAGES = ("numpy", "scipy", "onnxruntime", "opencv-contrib-python-headless", "torch")


def machine_info() -> dict:
    """CPU, cores, memory [GiB], load, system, versions of the packages that do the work, and the commit."""
    return {
        "cpu": _cpu_name(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "load_average": round(os.getloadavg()[0], 2),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: v for name in _PACKAGES if (v := package_version(name))},
        "commit": _commit(),
    }


def package_version(name: str) -> str | None:
    """Version of an installed distribution, None when it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _cpu_name() -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _commit() -> str | None:
    """Commit of the source tree, with `+` when files differ from it; None outside a git checkout."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty=+", "--exclude=*"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return result.stdout.strip() or None


# Distribution and its state here (docs/platforms.md), by the beginning of the version of its rclpy.
KNOWN = {
    "3.3.": ("Humble", "not supported: it lacks functions that the nodes call"),
    "7.1.": ("Jazzy", "tested"),
    "9.1.": ("Kilted", "tested"),
    "10.0.": ("Lyrical", "read, not tested: the nodes call nothing that its sources lack"),
}


def ros_distribution() -> str | None:
    """Return one line about the installed ROS 2; None without one."""
    version = package_version("ros-rclpy") or package_version("rclpy")  # the wheel's name, or that of a system ROS
    if version is None:
        return None
    for beginning, (name, state) in KNOWN.items():
        if version.startswith(beginning):
            return f"ROS 2 {name} (rclpy {version}): {state}"
    return f"ROS 2 with rclpy {version}: unknown here, not tested"
