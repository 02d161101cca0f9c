"""Look-up of codebook entries, timed on a running filter."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common.pose_metric import pose_distance
from midastouch_filter.core.particles import Particles
from midastouch_filter.filter import ParticleFilter

from .timing import CallTimer, time_calls

_REPEATS = 40
_TOLERANCE = 1.01


@dataclasses.dataclass(frozen=True)
class LookupSpeed:
    """Speed of look-ups. times: of one; exact_fraction: of poses whose entry is as near, within 1 %, as the nearest."""

    times: CallTimer
    exact_fraction: float


def lookup_speed(particle_filter: ParticleFilter, motion: np.ndarray) -> LookupSpeed:
    """Look up the untested poses of a filter on one object after a motion (4, 4) of the gel since the last keyframe.

    The walk starts at the entries that the filter's own look-ups have found, so their misses count, too.
    """
    lookup, untested = particle_filter.object.lookup, particle_filter.belief.untested[0]
    poses = untested.poses @ motion
    particles = Particles.from_poses(poses, untested.entries.copy())

    def look_up() -> np.ndarray:
        particles.entries[:] = untested.entries
        return lookup.follow(particles)

    times = time_calls(look_up, _REPEATS)
    nearest = pose_distance(lookup.poses[lookup.exact(poses)], poses)
    return LookupSpeed(times, float((look_up() <= _TOLERANCE * nearest + 1e-6).mean()))
