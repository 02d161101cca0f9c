"""What the launch files start, carried out by the launch that is installed on wheels."""

import itertools
from pathlib import Path

import yaml
from launch.on_wheels import commands

from midastouch_tools.ros.launch_file import SHARE, path_of

FILES = sorted(path.name.removesuffix(".launch.py") for path in (SHARE / "launch").glob("*.launch.py"))
COMPOSED = ("tdn", "tcn", "particle_filter")


def carried_out(name: str, folder: Path, **given: str) -> dict[str, list[str]]:
    """The command of each process that a launch file starts with these arguments, by executable."""
    return commands(path_of(name), {"use_rviz": "false", "prepare": "false", **given}, folder)


def parameters(command: list[str], node: str) -> dict:
    """Parameters of a node in the files that a command names, as rcl reads them: later files over earlier ones."""
    found: dict = {}
    for flag, path in itertools.pairwise(command):
        if flag == "--params-file":
            nodes = yaml.safe_load(Path(path).read_text())
            for key in ("/**", f"/**/{node}", node):
                found |= nodes.get(key, {}).get("ros__parameters", {})
    return found


def started(name: str, folder: Path, **given: str) -> dict[str, dict]:
    """The parameters of each node that a launch file starts."""
    found = carried_out(name, folder, **given)
    nodes = {node: command for one, command in found.items() for node in (COMPOSED if one == "all_in_one" else (one,))}
    return {node: parameters(command, node) for node, command in nodes.items()}
