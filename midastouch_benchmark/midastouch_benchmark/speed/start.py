"""Time until the filter is ready: until its process is active, and until a pose on an object without a codebook."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from midastouch_bringup.parameter_files import written
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.loaded_object import build_object
from midastouch_filter.localiser import Localiser
from midastouch_tools.processes.local_domain import local_environment, own_domain
from midastouch_tools.processes.process import node_program, resident_mb
from midastouch_tools.processes.supervisor import Supervisor

from ..statistics.intervals import ENOUGH, bootstrap_interval
from ..trials.cache import Cache

_NODE = "particle_filter"
_TIMEOUT_S = 300.0
_REPEATS = 5


def node_start(mesh: Path, codebook: Path) -> dict:
    """Return filter_start_s {p50, max}: from the start of a process of its own until the filter logs that it is active
    on an object; filter_rss_mb: its resident memory then, MiB, the largest of several starts.

    The log counts, since others find its lifecycle state by DDS, at once or 1.5 s later. Raises InputError if it does
    not become active, NodeFailed if it ends.
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
                    if time.monotonic() - begin > _TIMEOUT_S:
                        raise InputError(f"{_NODE} is not active after {_TIMEOUT_S:.0f} s: is the machine overloaded?")
                seconds.append(active.at - begin)
                memory.append(resident_mb(supervisor.pids[_NODE]))
    p50, most = np.percentile(seconds, [50, 100]).round(3).tolist()
    return {"filter_start_s": {"p50": p50, "max": most}, "filter_rss_mb": round(max(memory), 1)}


class _Active:
    """Listener to the output of a lifecycle node; said: set once it is active, at `at` [s] of the monotonic clock."""

    def __init__(self) -> None:
        self.said, self.at = threading.Event(), 0.0

    def __call__(self, name: str, line: str) -> None:
        if line.split()[-1:] == ["active"] and not self.said.is_set():
            self.at = time.monotonic()
            self.said.set()


def first_poses(mesh: ObjectMesh, cache: Cache, slides: Iterable[int], config: FilterConfig) -> list[dict]:
    """Return times of the first touch of each slide over an object that is requested by its mesh alone.

    build_s: until the filter has a codebook, once for all slides; step_s: from there to the touch's pose, while the
    codebook already grows; build_cpu_s: processor time of the former, which is reliable on a busy machine.
    """
    touches = {
        number: next(frame for frame in cache.frames(mesh, number) if frame.measurement.in_contact) for number in slides
    }
    wall, cpu = time.perf_counter(), time.process_time()
    localiser = Localiser(None, wait=False)
    localiser.set_object(build_object(mesh.path, cache.tcn, cache.sensor, config, seed=0))
    build = {"build_s": time.perf_counter() - wall, "build_cpu_s": time.process_time() - cpu}
    trials = []
    try:
        for number, frame in touches.items():
            localiser.restart()
            wall = time.perf_counter()
            localiser.process(frame.measured, frame.measurement)
            trials.append({"object": mesh.name, "slide": number, "step_s": time.perf_counter() - wall} | build)
    finally:
        localiser.close()
    return trials


def summarise_first_poses(trials: list[dict]) -> dict:
    """Return first_pose_s: median, longest, and the median's 95 % interval over objects; build_cpu_s: mean; trials;
    objects; enough: whether there are enough trials for a claim."""
    seconds = [trial["build_s"] + trial["step_s"] for trial in trials]
    objects = [trial["object"] for trial in trials]
    return {
        "trials": len(trials),
        "objects": len(set(objects)),
        "enough": len(trials) >= ENOUGH,
        "first_pose_s": {
            "value": float(np.median(seconds)),
            "interval": bootstrap_interval(seconds, objects, np.median),
            "max": max(seconds),
        },
        "build_cpu_s": float(np.mean([trial["build_cpu_s"] for trial in trials])),
    }
