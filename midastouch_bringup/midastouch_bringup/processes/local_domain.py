"""Nodes for our own use, as of the demo: in a DDS domain that only this machine sees, with logs in a folder."""

from __future__ import annotations

import os
from pathlib import Path


def own_domain() -> int:
    """The ROS_DOMAIN_ID of the environment; without one, a number that this process hardly shares."""
    return int(os.environ.get("ROS_DOMAIN_ID", 1 + os.getpid() % 101))


def local_environment(domain: int, **more: str) -> dict[str, str]:
    """Our environment for nodes in a domain that only this machine sees."""
    return {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **more}


class LogFolder:
    """Output of processes as files: `NAME.log` each, begun anew."""

    def __init__(self, folder: Path):
        self._folder, self._begun = folder, set()
        folder.mkdir(parents=True, exist_ok=True)

    def __call__(self, name: str, line: str) -> None:
        with (self._folder / f"{name}.log").open("a" if name in self._begun else "w") as log:
            self._begun.add(name)
            log.write(f"{line}\n")
