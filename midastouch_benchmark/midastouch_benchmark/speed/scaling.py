"""Time of a filter step and memory over hypotheses and codebook poses, each filter in its own process."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook

from .timing import CallTimer, peak_rss_mb

USUAL = 50_000
"""Usual number of hypotheses at the start, as many as the paper's particles, and of poses of a codebook; it is kept for
the one that is not varied."""
PARTICLES = (100, 1_000, 10_000, USUAL)
POSES = (1_000, 10_000, USUAL, 100_000, 1_000_000)


Steps = Sequence[tuple[np.ndarray | None, Measurement]]
"""Input of every filter: odometry and touch of each step."""


def measure(mesh: Path, codebook: Path, steps: Steps, particles: int) -> dict:
    """Measure one step, with its deferred work, on a codebook of which `particles` poses are hypotheses at the start.

    step_ms: as of `CallTimer`; memory_mb: the most that a process with this filter alone needs, MiB.

    InputError if the process dies, as it does if memory is short.
    """
    # spawned: a forked process would begin with the memory of this one
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as process:
        try:
            return process.submit(_measure, mesh, codebook, steps, particles).result()
        except BrokenProcessPool as error:
            raise InputError(
                f"{codebook}: the process with {particles} hypotheses died; memory is short, give fewer"
            ) from error


def _measure(mesh_path: Path, codebook: Path, steps: Steps, particles: int) -> dict:
    mesh, stopwatch = ObjectMesh.load(mesh_path), CallTimer()
    config = FilterConfig(max_particles=particles)
    particle_filter = ParticleFilter(mesh, Codebook.load(codebook, mesh=mesh), config)
    particle_filter.initialise_uniform()
    for odometry, touch in steps:
        with stopwatch:
            particle_filter.step(odometry, touch)
            particle_filter.deferred_update()
    stopwatch.drop(2)
    return {"step_ms": stopwatch.summary(), "memory_mb": peak_rss_mb()}


def sizes(particles: Sequence[int], poses: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield hypotheses and poses of every filter: each number of the one with the usual number of the other."""
    yield from dict.fromkeys([*((count, USUAL) for count in particles), *((USUAL, size) for size in poses)])
