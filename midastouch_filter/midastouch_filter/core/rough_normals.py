"""Normals of a surface as a gel of finite size feels them, in a fraction of the time that `smooth_normals` takes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

_POINTS = 10_000
_NEAREST = 4  # points; one of them is on the same side of a thin plate


class RoughNormals:
    """Those of the nearest one of 10,000 points of the surface.

    Attributes: values (10000, 6) float32, the points [m] and their outward normals.
    """

    def __init__(self, mesh: ObjectMesh, values: np.ndarray | None = None):
        """`values` of earlier ones of this mesh, if there are any."""
        self._mesh = mesh
        if values is None:
            points = mesh.sample_surface(_POINTS, np.random.default_rng(0))[0]
            values = np.concatenate([points, mesh.smooth_normals(points)], axis=1).astype(np.float32)
        elif values.shape != (_POINTS, 6):
            raise InputError(f"normals {values.shape} are not of {_POINTS} points")
        self.values = values
        self._tree = cKDTree(values[:, :3])  # without threads: queries are small

    def at(self, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Outward normals (N, 3) at surface points (N, 3), on the side to which the mesh's `faces` (N,) look."""
        near = self.values[self._tree.query(points, k=_NEAREST)[1], 3:].astype(float)
        facing = np.einsum("nkj,nj->nk", near, self._mesh.face_normals[faces]) > 0
        return near[np.arange(len(near)), np.argmax(facing, axis=1)]
