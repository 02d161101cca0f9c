"""Prediction of slides on the surface of an object: straightest geodesics, many at once.

A finger that follows the surface turns with its normal and no further (parallel transport), so a heading stays fixed in
its gel's plane. Compared with `straight_on` of the simulator, steps are longer and normals rougher, and the codebook
shows which poses can touch.
"""

from __future__ import annotations

import math

import numpy as np

from midastouch_common import se3
from midastouch_common.pose_metric import pose_distance
from midastouch_common.surface_walk import MIN_PROGRESS
from midastouch_perception.codebook import PRESS

from ..core.object_model import ObjectModel
from ..core.surface import DEAD_DISTANCE

_STEP = 7.5e-3  # m; a gel is 19 mm wide
_SIGMA = 1e-3  # m: distance of touches beyond the reach of a codebook's poses, sigma
_TOUCHES = 8  # most touches of a slide, at growing distances


def predict_slides(
    model: ObjectModel, starts: np.ndarray, headings: np.ndarray, distances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return gel poses (H, K, T + 1, 4, 4) along slides, and at which (H, K, T + 1) of them the gel can touch.

    starts (H, 4, 4) `T_obj_gel`, headings (K,) [rad] in the gel's plane, from its x to its y axis; distances (T,) [m]
    along the surface, ascending. The first pose of a slide is its start, laid flat onto the surface. After a pose at
    which the gel cannot touch, as in a fold or below a rim, it may be able to again.
    """
    shape = len(starts), len(headings)
    walk = _Walk(model, np.repeat(starts, shape[1], axis=0), np.tile(headings, shape[0]))
    poses, alive, before = [walk.poses], [walk.alive.copy()], 0.0
    for distance in distances:
        walk.advance(distance - before)
        poses.append(walk.poses)
        alive.append(walk.alive.copy())
        before = distance
    every = np.stack(poses, axis=1).reshape(*shape, len(distances) + 1, 4, 4)
    # further from the codebook, the filter would take a touch for an outlier
    _, log_weight = nearest_and_log_weight(model, every)
    near = log_weight > np.log(model.measurement.outlier)
    return every, np.stack(alive, axis=1).reshape(every.shape[:3]) & near


def nearest_and_log_weight(model: ObjectModel, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the codebook's entries nearest to poses (..., 4, 4) of a gel that touches, and log-weights (...) <= 0 of
    the poses by their distances to these; a pose that is too far off to matter gets any entry."""
    within = model.lookup.largest_gap
    entries, distance = model.lookup.nearest(poses.reshape(-1, 4, 4), within + DEAD_DISTANCE)
    beyond = np.clip(distance - within, 0.0, DEAD_DISTANCE)
    log_weight = -0.5 / _SIGMA**2 * np.square(beyond, dtype=float)
    return entries.reshape(poses.shape[:-2]), log_weight.reshape(poses.shape[:-2])


class _Walk:
    """Walk of N gels over a surface."""

    def __init__(self, model: ObjectModel, starts: np.ndarray, headings: np.ndarray):
        self._mesh, self._normals = model.mesh, model.normals
        self._position, _, face = self._mesh.closest_points(starts[:, :3, 3])
        self._rotation = _laid_flat(starts[:, :3, :3], self._normals.at(self._position, face))
        ahead = np.stack([np.cos(headings), np.sin(headings), np.zeros(len(headings))], axis=1)
        self._heading = np.einsum("nij,nj->ni", self._rotation, ahead)
        self.alive = np.ones(len(starts), bool)

    @property
    def poses(self) -> np.ndarray:
        """Gel poses (N, 4, 4), pressed as those of codebooks are."""
        return se3.make(self._rotation, self._position - PRESS * self._rotation[:, :, 2])

    def advance(self, distance: float) -> None:
        """Advance by `distance` [m]; a gel in a fold, where the closest point falls back, stays there."""
        steps = max(round(distance / _STEP), 1)
        for _ in range(steps):
            step, going = distance / steps, np.flatnonzero(self.alive)
            here = self._position[going]
            position, _, face = self._mesh.closest_points(here + step * self._heading[going])
            moved = position - here
            normal = self._normals.at(position, face)
            tangent = moved - np.einsum("ni,ni->n", moved, normal)[:, None] * normal
            length = np.linalg.norm(tangent, axis=1)
            good = length > MIN_PROGRESS * step
            self.alive[going[~good]] = False
            going = going[good]
            self._position[going] = position[good]
            self._heading[going] = tangent[good] / length[good, None]
            self._rotation[going] = _laid_flat(self._rotation[going], normal[good])


def _laid_flat(rotations: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Turn rotations (N, 3, 3) by the smallest angle after which their z axes are the normals (N, 3)."""
    z = rotations[:, :, 2]
    axis, cosine = np.cross(z, normals), np.einsum("ni,ni->n", z, normals)
    sine = np.linalg.norm(axis, axis=1)
    turn = axis * (np.arctan2(sine, cosine) / np.maximum(sine, 1e-9))[:, None]
    return se3.exp(np.concatenate([np.zeros_like(turn), turn], axis=1))[:, :3, :3] @ rotations


def touches_on_the_way(length: float, spacing: float) -> np.ndarray:
    """Return distances (T,) [m] of touches on a way of `length` [m]: the first at `spacing`, then at growing steps."""
    count = int(np.clip(length / spacing, 1, _TOUCHES))
    if count == 1:
        return np.array([length])
    power = max(math.log(length / spacing) / math.log(count), 1.0)
    return length * (np.arange(1, count + 1) / count) ** power


def independence_on_the_way(tracks: np.ndarray, measured: np.ndarray, correlation: float) -> np.ndarray:
    """Return how much of an independent touch each one on the way is, (H, K, T) in [0, 1], as `Track.keep` does.

    tracks (H, K, T + 1, 4, 4); measured (F, 4, 4), in the frame of the start.
    """
    out = np.ones((*tracks.shape[:2], tracks.shape[2] - 1))
    before = tracks[:, :, 0, None] @ measured
    for t in range(out.shape[2]):
        older = np.concatenate([before, tracks[:, :, : t + 1]], axis=2)
        distance = pose_distance(older, tracks[:, :, t + 1, None])
        out[:, :, t] = np.minimum(distance.min(axis=2) / correlation, 1.0)
    return out
