"""Exact closest-point and ray queries on a list of triangles, by trees of bounding boxes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

# A batch of this size takes some 10 ms: libigl holds the interpreter's lock, and a node has other threads.
_POINTS_AT_ONCE, _RAYS_AT_ONCE = 2000, 400
_MICROMETRES = 1e6  # libigl's rays pass through triangles of less than 1e-6 square units


class ClosestPointSearch:
    """Nearest surface points. Args: vertices (V, 3) float64, m; faces (F, 3), indices of vertices."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        self._vertices, self._faces = vertices, faces.astype(np.int64)
        self._tree = _tree(self._vertices, self._faces)

    def query(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return closest points (N, 3), distances (N,) m and faces (N,) of points (N, 3), which are C-contiguous.

        For points that are not finite these are NaN and face 0."""
        closest, distance, face = np.empty((len(points), 3)), np.empty(len(points)), np.empty(len(points), np.int64)
        for part in _parts(len(points), _POINTS_AT_ONCE):
            squared, face[part], closest[part] = self._tree.squared_distance(self._vertices, self._faces, points[part])
            distance[part] = np.sqrt(squared)
        lost = ~np.isfinite(distance)  # for points that are not finite the tree leaves face and closest point unset
        closest[lost], distance[lost], face[lost] = np.nan, np.nan, 0
        return closest, distance, face


class RaySearch:
    """Tests of rays against the surface. Args as in `ClosestPointSearch`."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        self._vertices, self._faces = _MICROMETRES * vertices, faces.astype(np.int64)
        self._tree = _tree(self._vertices, self._faces)

    def meets(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return whether (N,) rays from origins (N, 3) m along directions (N, 3) meet a face, from either side."""
        face = np.empty(len(origins), np.int64)
        for part in _parts(len(origins), _RAYS_AT_ONCE):
            rays = _MICROMETRES * origins[part], np.ascontiguousarray(directions[part])
            face[part] = self._tree.intersect_ray_first(self._vertices, self._faces, *rays)[0]
        return face >= 0


def _tree(vertices: np.ndarray, faces: np.ndarray):
    # Imported only here: a filter whose codebook holds the distances never queries a closest point.
    from igl import AABB

    tree = AABB()
    tree.init(vertices, faces)
    return tree


def _parts(count: int, at_once: int) -> Iterator[slice]:
    return (slice(low, low + at_once) for low in range(0, count, at_once))
