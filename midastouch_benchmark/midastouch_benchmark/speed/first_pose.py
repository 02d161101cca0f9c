"""How soon there is a pose on an object that comes without a codebook."""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.loaded_object import build_object
from midastouch_filter.localiser import Localiser

from ..statistics.intervals import ENOUGH, bootstrap_interval
from ..trials.stock import Stock


def first_poses(mesh: ObjectMesh, stock: Stock, slides: Iterable[int], config: FilterConfig) -> list[dict]:
    """Of the first touch of each slide over an object that is asked for by its mesh alone.

    build_s, until the filter has a codebook, once for all slides; step_s, from there to the touch's pose, while the
    codebook already grows; build_cpu_s, processor time of the former, which survives a busy machine.
    """
    touches = {number: _first_touch(stock, mesh, number) for number in slides}
    wall, cpu = time.perf_counter(), time.process_time()
    localiser = Localiser(None, wait=False)
    localiser.set_object(build_object(mesh.path, stock.tcn, stock.sensor, config, seed=0))
    build = {"build_s": time.perf_counter() - wall, "build_cpu_s": time.process_time() - cpu}
    trials = []
    try:
        for number, frame in touches.items():
            localiser.restart()
            wall = time.perf_counter()
            localiser.process(frame.measured, frame.felt)
            trials.append({"object": mesh.name, "slide": number, "step_s": time.perf_counter() - wall} | build)
    finally:
        localiser.close()
    return trials


def _first_touch(stock: Stock, mesh: ObjectMesh, number: int):
    sequence, touches = stock.touches(mesh, number)
    return next(frame for frame in touches.frames(sequence, 1) if frame.felt.in_contact)


def summarise_first_poses(trials: list[dict]) -> dict:
    """first_pose_s: median, longest, and the median's 95 % interval over objects; build_cpu_s, mean; trials; objects;
    enough: whether there are trials enough for a claim."""
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
