"""An object with places that feel exactly alike: several copies of one object, side by side."""

from __future__ import annotations

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook

_APART = 0.03  # m, more than the gel is wide: a sensor on one copy does not see the next


class Twins:
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
