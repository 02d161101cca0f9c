"""How long the filter's process takes from its start until it is active, and how much memory it then has."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

from midastouch_perception.errors import InputError

from ..node_processes import NodeProcesses, resident_mb

_NODE = "particle_filter"
_PATIENCE_S = 300.0


def node_start(mesh: Path, codebook: Path, repeats: int = 5) -> dict:
    """filter_start_s {p50, max}: from the start of a process of its own until the filter says in its log that it is
    active on an object; filter_rss_mb: its resident memory then, MiB, the largest of the repeats.

    How soon others find it is up to DDS: at once, or seconds later. Raises InputError if it does not become active,
    NodeFailed if it ends.
    """
    domain = int(os.environ.get("ROS_DOMAIN_ID", 1 + os.getpid() % 101))
    settings = {_NODE: {"ros__parameters": {"mesh": str(mesh.resolve()), "codebook": str(codebook.resolve())}}}
    seconds, memory = [], []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            parameters = Path(folder, "filter.yaml")
            parameters.write_text(yaml.safe_dump(settings))
            with NodeProcesses(Path(folder), domain) as processes:
                begin = time.monotonic()
                processes.start(_NODE, parameters)
                while "active" not in processes.log(_NODE):
                    processes.check(_NODE)
                    if time.monotonic() - begin > _PATIENCE_S:
                        raise InputError(f"{_NODE} is not active after {_PATIENCE_S:.0f} s: is the machine overloaded?")
                    time.sleep(0.005)
                seconds.append(time.monotonic() - begin)
                memory.append(resident_mb(processes.pids[_NODE]))
    p50, most = np.percentile(seconds, [50, 100]).round(3).tolist()
    return {"filter_start_s": {"p50": p50, "max": most}, "filter_rss_mb": round(max(memory), 1)}
