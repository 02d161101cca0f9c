"""Nearest neighbours among fixed points, for many queries at once or one after another."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from pykdtree.kdtree import KDTree
from scipy.spatial import cKDTree

WORTH_THREADS = 8
"""Queries; fewer are answered sooner than threads are woken, on a busy machine by milliseconds."""


class NearestPoints:
    """KD-tree of points (M, D)."""

    def __init__(self, points: np.ndarray):
        self._points = points
        self._threaded = KDTree(points)

    @cached_property
    def _unthreaded(self) -> cKDTree:
        return cKDTree(self._points)

    def query(self, queries: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Distances and indices of the k nearest points of queries (N, D), nearest first: (N, k), or (N,) for k = 1."""
        tree = self._unthreaded if len(queries) < WORTH_THREADS else self._threaded
        return tree.query(np.ascontiguousarray(queries, float), k=k)
