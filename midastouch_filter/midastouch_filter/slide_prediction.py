"""Where a slide leads on the surface of an object: straightest geodesics, walked on the grid of distances.

A finger that follows the surface turns with its normal and no further (parallel transport), so that a heading in its
gel's plane stays one. Many slides are walked at once; a slide of the simulator, which looks for exact closest points,
takes a hundred times as long.
"""

from __future__ import annotations

import numpy as np

from midastouch_perception import se3
from midastouch_perception.codebook_poses import PRESS

from .object_model import ObjectModel

_STEP = 3e-3  # m; a gel is 19 mm wide
_PROGRESS = 0.3  # of a step; less is a fold, in which the closest point falls back


def predict_slides(
    model: ObjectModel, starts: np.ndarray, headings: np.ndarray, distances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gel poses (H, K, T + 1, 4, 4) along slides, and which (H, K, T + 1) of them the gel can touch at.

    starts (H, 4, 4) `T_obj_gel`, headings (K,) [rad] in the gel's plane, from its x to its y axis; distances (T,) [m]
    along the surface, ascending. The first pose of a slide is its start, laid flat onto the surface. Where a pose
    cannot be touched at, as in a fold or below a rim, later ones may be again.
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
    return every, np.stack(alive, axis=1).reshape(every.shape[:3]) & touchable(model, every)


def touchable(model: ObjectModel, poses: np.ndarray) -> np.ndarray:
    """Which (...) of poses (..., 4, 4) are near some pose of the codebook: farther off, the filter would rather take
    a touch for chance."""
    _, distance = model.lookup.nearest(poses.reshape(-1, 4, 4))
    log_weight = model.surface.bounded_log_weight(np.zeros(len(distance)), distance, True, model.config.surface_sigma)
    return (log_weight > np.log(model.measurement.outlier)).reshape(poses.shape[:-2])


class _Walk:
    """N gels on their way over a surface."""

    def __init__(self, model: ObjectModel, starts: np.ndarray, headings: np.ndarray):
        self._project = lambda points: model.surface.grid.projected(points, model.workers)
        self._ahead = np.stack([np.cos(headings), np.sin(headings), np.zeros(len(headings))], axis=1)
        self._position, normal, self.alive = self._project(starts[:, :3, 3])
        self._rotation = _laid_flat(starts[:, :3, :3], normal)

    @property
    def poses(self) -> np.ndarray:
        """Gel poses (N, 4, 4), pressed as those of codebooks are."""
        return se3.make(self._rotation, self._position - PRESS * self._rotation[:, :, 2])

    def advance(self, distance: float) -> None:
        """Go on by so many metres."""
        steps = max(round(distance / _STEP), 1)
        for _ in range(steps):
            step = distance / steps
            goal = self._position + step * np.einsum("nij,nj->ni", self._rotation, self._ahead)
            position, normal, found = self._project(goal)
            progress = np.linalg.norm(position - self._position, axis=1)
            self.alive &= found & (progress > _PROGRESS * step)
            self._position = np.where(self.alive[:, None], position, self._position)
            normal = np.where(self.alive[:, None], normal, self._rotation[:, :, 2])
            self._rotation = _laid_flat(self._rotation, normal)


def _laid_flat(rotations: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Rotations (N, 3, 3) turned by the smallest angle after which their z axes are the normals (N, 3)."""
    z = rotations[:, :, 2]
    axis, cosine = np.cross(z, normals), np.einsum("ni,ni->n", z, normals)
    x = np.cross(axis[:, None], np.swapaxes(rotations, 1, 2))  # axis x each column, as rows
    xx = np.cross(axis[:, None], x)
    turned = np.swapaxes(rotations, 1, 2) + x + xx / np.maximum(1.0 + cosine, 1e-6)[:, None, None]
    return np.swapaxes(turned, 1, 2)
