"""Speed and exactness of the codebook look-up, on the particles of a running filter."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.lookup import PoseLookup, space_filling_order
from midastouch_filter.core.motion_model import MotionModel, Odometry
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter

from .timing import Stopwatch, time_calls

_REPEATS = 40
_TOLERANCE = 1.01


@dataclasses.dataclass(frozen=True)
class LookupSpeed:
    """times of one look-up; exact_share, of the particles whose entry is as near, within 1 %, as the nearest one."""

    times: Stopwatch
    exact_share: float


def lookup_speed(
    particle_filter: ParticleFilter, book_poses: np.ndarray, odometry: np.ndarray, rng: np.random.Generator
) -> LookupSpeed:
    """Look up the particles of a filter after one more step of `odometry` (4, 4) and motion noise.

    The walk starts at the entries that the filter's own look-ups have come to, so what they missed counts too.
    `book_poses` (M, 4, 4) are the codebook's.
    """
    workers = Workers()
    order = space_filling_order(book_poses)
    lookup = PoseLookup(book_poses[order], workers)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order))
    before = rank[particle_filter.codebook_indices]
    particles = Particles.from_poses(particle_filter.poses, before)
    motion = MotionModel(FilterConfig(), rng, workers)
    motion.propagate(particles, Odometry.from_matrix(odometry), exploration=1.0)

    def look_up() -> np.ndarray:
        particles.entries[:] = before
        return lookup.follow(particles)

    times = time_calls(look_up, _REPEATS)
    found = look_up()
    lookup.relocate(particles)
    nearest = lookup.follow(particles)
    return LookupSpeed(times, float((found <= _TOLERANCE * nearest + 1e-6).mean()))
