"""The nodes of the pipeline as processes of their own, in the DDS domain of the environment."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import yaml

SHIPPED = {
    "tdn": ["-m", "midastouch_perception.nodes.tdn"],
    "tcn": ["-m", "midastouch_perception.nodes.tcn"],
    "particle_filter": ["-m", "midastouch_filter.nodes.particle_filter"],
}
"""What Python runs, by node."""


def started(module: str, *arguments: str) -> subprocess.Popen:
    """A node as a process, with ROS arguments; what it says is kept."""
    command = [sys.executable, "-m", module, "--ros-args", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@contextlib.contextmanager
def processes(commands: dict[str, list[str]], parameters: dict[str, dict], folder: Path) -> Iterator[None]:
    """Run what Python is told, by node, with its parameters, from a file in `folder`; all must end well in the end."""
    config = folder / "nodes.yaml"
    config.write_text(yaml.safe_dump({name: {"ros__parameters": parameters[name]} for name in commands}))
    running = [
        subprocess.Popen([sys.executable, *command, "--ros-args", "--params-file", str(config)])
        for command in commands.values()
    ]
    try:
        yield
    finally:
        for process in running:
            process.send_signal(signal.SIGINT)
        codes = [process.wait(timeout=60) for process in running]
    assert set(codes) == {0}
