"""How long the filter's process takes from its start until it is active, and how much memory it then has."""

from __future__ import annotations

import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from midastouch_bringup.processes.local_domain import local_environment, own_domain
from midastouch_bringup.processes.parameter_files import written
from midastouch_bringup.processes.process import node_program, resident_mb
from midastouch_bringup.processes.supervisor import Supervisor
from midastouch_common.errors import InputError

_NODE = "particle_filter"
_PATIENCE_S = 300.0
_REPEATS = 5


def node_start(mesh: Path, codebook: Path) -> dict:
    """filter_start_s {p50, max}: from the start of a process of its own until the filter says that it is active on an
    object; filter_rss_mb: its resident memory then, MiB, the largest of so many.

    Said in its log: how soon others find its lifecycle state is up to DDS, at once or 1.5 s later. Raises InputError if
    it does not become active, NodeFailed if it ends.
    """
    settings = {_NODE: {"mesh": str(mesh.resolve()), "codebook": str(codebook.resolve())}}
    seconds, memory = [], []
    with tempfile.TemporaryDirectory() as folder:
        parameters = Path(folder, "filter.yaml")
        parameters.write_text(written(settings, ""))
        for _ in range(_REPEATS):
            active = _Active()
            with Supervisor(local_environment(own_domain(), ROS_LOG_DIR=folder), active) as supervisor:
                begin = time.monotonic()
                supervisor.start(node_program(_NODE, parameters))
                while not active.said.wait(0.05):
                    supervisor.look_after()
                    if time.monotonic() - begin > _PATIENCE_S:
                        raise InputError(f"{_NODE} is not active after {_PATIENCE_S:.0f} s: is the machine overloaded?")
                seconds.append(active.at - begin)
                memory.append(resident_mb(supervisor.pids[_NODE]))
    p50, most = np.percentile(seconds, [50, 100]).round(3).tolist()
    return {"filter_start_s": {"p50": p50, "max": most}, "filter_rss_mb": round(max(memory), 1)}


class _Active:
    """Hears the output of a lifecycle node; said: that it is active, `at` [s] of the monotonic clock."""

    def __init__(self) -> None:
        self.said, self.at = threading.Event(), 0.0

    def __call__(self, name: str, line: str) -> None:
        if line.split()[-1:] == ["active"] and not self.said.is_set():
            self.at = time.monotonic()
            self.said.set()
