"""Domain and logs of nodes for our own use, such as the demo's: only this machine sees them."""

from __future__ import annotations

import functools
import itertools
import os
import socket
from pathlib import Path

_claims: list[socket.socket] = []  # bound as long as this process lives


@functools.cache
def claimed_domain() -> int:
    """Claim a DDS domain, for as long as this process lives, from other demos, measurements and tests on this machine.

    It is one of 1 to 101, whose ports Linux keeps out of its ephemeral range. Raises RuntimeError if all are taken.
    """
    for domain in itertools.chain(range(1 + os.getpid() % 101, 102), range(1, 102)):
        claim = socket.socket(socket.AF_UNIX)
        try:
            # abstract, so it is free again when the process is gone, however it ends
            claim.bind(f"\0midastouch_domain_{domain}")
        except OSError:
            claim.close()
        else:
            _claims.append(claim)
            return domain
    raise RuntimeError("all 101 DDS domains are in use by running midastouch commands")


def own_domain() -> int:
    """The ROS_DOMAIN_ID of the environment; without one, a domain that this process claims."""
    return int(os.environ["ROS_DOMAIN_ID"]) if "ROS_DOMAIN_ID" in os.environ else claimed_domain()


def local_environment(domain: int, **more: str) -> dict[str, str]:
    """Our environment for nodes in a domain that only this machine sees."""
    return {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **more}


class LogFolder:
    """Output of processes as files: `NAME.log` each, overwritten."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._begun: set[str] = set()
        folder.mkdir(parents=True, exist_ok=True)

    def __call__(self, name: str, line: str) -> None:
        with (self._folder / f"{name}.log").open("a" if name in self._begun else "w") as log:
            self._begun.add(name)
            log.write(f"{line}\n")
