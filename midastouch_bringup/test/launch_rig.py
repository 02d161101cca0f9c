"""Launch files carried out by stand-ins of `launch`, which PyPI does not have."""

from pathlib import Path

import yaml
from fake_launch import Launched

AN_ARM = {"arm": "rtde", "robot_ip": "the.arm"}


def carry_out(name, **given):
    """All processes a launch starts: (package, executable) -> keyword arguments of its node."""
    return Launched().carry_out(name, **given)


def parameters(kwargs):
    """Parameters by full node name, of a node started by us."""
    (path,) = kwargs["parameters"]
    return {name: node["ros__parameters"] for name, node in yaml.safe_load(Path(path).read_text()).items()}


def names(started):
    return {executable for _, executable in started}
