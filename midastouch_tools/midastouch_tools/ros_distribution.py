"""The installed ROS 2 distribution, and whether it is tested. docs/platforms.md has more about each."""

from __future__ import annotations

from .machine import package_version

# Distribution and its state here, by the beginning of the version of its rclpy.
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
