"""The look-up of codebook entries, timed on a running filter; an object with poses that are exactly alike."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.lookup import PoseLookup, space_filling_order
from midastouch_filter.core.motion_model import MotionModel, Odometry
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook

from .timing import CallTimer, time_calls

_REPEATS = 40
_TOLERANCE = 1.01


@dataclasses.dataclass(frozen=True)
class LookupSpeed:
    """times of one look-up; exact_fraction, of the particles whose entry is as near, within 1 %, as the nearest one."""

    times: CallTimer
    exact_fraction: float


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


_APART = 0.03  # m, more than the gel is wide: a sensor on one copy does not see the next


class AlikeCopies:
    """So many copies of an object, the first where it is, and a codebook of as many poses as its own.

    Each copy gets the first of the codebook's poses: as a codebook is spread over the surface by farthest points, they
    cover it evenly. Attributes: mesh; codebook.
    """

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, count: int):
        extent = mesh.bounds[1] - mesh.bounds[0]
        axis = int(np.argmin(extent))
        self._shifts = np.arange(count)[:, None] * (extent[axis] + _APART) * np.eye(3)[axis]
        vertices = (mesh.vertices + self._shifts[:, None]).reshape(-1, 3)
        faces = (mesh.faces + len(mesh.vertices) * np.arange(count)[:, None, None]).reshape(-1, 3)
        self.mesh = ObjectMesh.from_arrays(vertices, faces, f"{count} x {mesh.name}")
        each = len(codebook.poses) // count
        poses = np.tile(codebook.poses[:each], (count, 1, 1))
        poses[:, :3, 3] += np.repeat(self._shifts, each, axis=0)
        self.codebook = Codebook(poses, np.tile(codebook.codes[:each], (count, 1)), codebook.meta)

    def on_every_copy(self, pose: np.ndarray) -> np.ndarray:
        """(count, 4, 4), that on each copy which `pose` (4, 4) is on the first."""
        poses = np.repeat(pose[None], len(self._shifts), axis=0)
        poses[:, :3, 3] += self._shifts
        return poses
