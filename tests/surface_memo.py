"""What a filter derives of a mesh's surface, half a second of work, is derived once of each mesh in a test process."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.surface import SurfaceGrid

_MANY = 1000  # points, from which on their normals are worth keeping


def _digest(*arrays: np.ndarray) -> bytes:
    """Of shapes and contents: meshes are told apart by what they hold, for tests change them."""
    digest = hashlib.sha1(usedforsecurity=False)
    for array in arrays:
        digest.update(str((array.shape, array.dtype)).encode())
        digest.update(np.ascontiguousarray(array))
    return digest.digest()


@pytest.fixture(scope="session", autouse=True)
def _derived_once() -> Iterator[None]:
    """The very numbers that would be computed again, in arrays of their own."""
    normals_of, fill = ObjectMesh.smooth_normals, SurfaceGrid._fill
    normals: dict[tuple, np.ndarray] = {}
    distances: dict[tuple, np.ndarray] = {}

    def smooth_normals(mesh: ObjectMesh, points: np.ndarray, radius: float = 4e-3) -> np.ndarray:
        if len(points) < _MANY:
            return normals_of(mesh, points, radius)
        key = (_digest(mesh.vertices, mesh.faces, mesh.face_normals, points), radius)
        if key not in normals:
            normals[key] = normals_of(mesh, points, radius)
        return normals[key].copy()

    def fill_once(grid: SurfaceGrid, mesh: ObjectMesh) -> None:
        key = (_digest(mesh.vertices, mesh.faces, mesh.face_normals), grid.limit, grid.spacing)
        if key not in distances:
            fill(grid, mesh)
            distances[key] = grid.values.copy()
        grid.values[:] = distances[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ObjectMesh, "smooth_normals", smooth_normals)
        patch.setattr(SurfaceGrid, "_fill", fill_once)
        yield
