"""What a filter derives of a mesh's surface, half a second of work, is derived once of each mesh in a test process."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core import surface

_MANY = 1000  # points, from which on what is found of them is worth keeping


def _digest(*arrays: np.ndarray) -> bytes:
    """Of shapes and contents: meshes are told apart by what they hold, for tests change them."""
    digest = hashlib.sha1(usedforsecurity=False)
    for array in arrays:
        digest.update(str((array.shape, array.dtype)).encode())
        digest.update(np.ascontiguousarray(array))
    return digest.digest()


def _once(function: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """A function of a mesh and points that computes its array once, and gives out copies of it."""
    kept: dict[tuple, np.ndarray] = {}

    @functools.wraps(function)
    def remembered(mesh: ObjectMesh, points: np.ndarray, *more) -> np.ndarray:
        if len(points) < _MANY:
            return function(mesh, points, *more)
        key = (_digest(mesh.vertices, mesh.faces, mesh.face_normals, points), more)
        if key not in kept:
            kept[key] = function(mesh, points, *more)
        return kept[key].copy()

    return remembered


@pytest.fixture(scope="session", autouse=True)
def _derived_once() -> Iterator[None]:
    """Normals and distances are the very numbers that would be computed again."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ObjectMesh, "smooth_normals", _once(ObjectMesh.smooth_normals))
        patch.setattr(surface, "signed_distance", _once(surface.signed_distance))
        yield
