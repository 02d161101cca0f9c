"""Launch files carried out by stand-ins of `launch`, which PyPI does not have."""

from pathlib import Path

import yaml
from fake_launch import OURS, Launched

AN_ARM = {"arm": "rtde", "robot_ip": "the.arm"}
BOX = {"params_overlay": str(Path(__file__).with_name("box.yaml"))}


def given_to(name):
    """What a launch file cannot do without, or does more with."""
    return {"live_ur": AN_ARM, "explore_ur": {**AN_ARM, **BOX}}.get(name, {})


def carry_out(name, **given):
    """All processes a launch starts: (package, executable) -> keyword arguments of its node."""
    return Launched().carry_out(name, **given)


def parameters(kwargs):
    """Parameters by full node name, of a node started by us."""
    (path,) = kwargs["parameters"]
    return {name: node["ros__parameters"] for name, node in yaml.safe_load(Path(path).read_text()).items()}


def own_parameters(started):
    """Node -> its parameters, of each process that is named like its only node, without a namespace."""
    ours = {name: kwargs for (package, name), kwargs in started.items() if package in OURS and name != "all_in_one"}
    return {name: parameters(kwargs)[f"/{name}"] for name, kwargs in ours.items()}


def names(started):
    return {executable for _, executable in started}
