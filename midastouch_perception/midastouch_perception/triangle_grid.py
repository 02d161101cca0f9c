"""A uniform grid over a triangle soup: which triangles may lie in which cell."""

from __future__ import annotations

import numba
import numpy as np


class TriangleGrid:
    """Cells -> triangles whose bounding box meets them.

    Attributes: corners (F, 3, 3) m; origin (3,) m; cell, edge length m; shape (3,); the triangles of cell c
    (x-major flat index) are `items[start[c]:start[c + 1]]`.
    """

    def __init__(self, corners: np.ndarray, cell: float):
        self.corners = np.ascontiguousarray(corners, float)
        low, high = self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))
        self.cell = float(cell)
        self.origin = low - 0.5 * self.cell
        self.shape = np.ceil((high - self.origin) / self.cell).astype(np.int64) + 1
        self.start, self.items = _fill(self.corners, self.origin, self.cell, self.shape)


@numba.njit(cache=True)
def _fill(corners, origin, cell, shape):
    n = corners.shape[0]
    low, high = np.empty((n, 3), np.int64), np.empty((n, 3), np.int64)
    for f in range(n):
        for k in range(3):
            smallest = min(corners[f, 0, k], corners[f, 1, k], corners[f, 2, k])
            largest = max(corners[f, 0, k], corners[f, 1, k], corners[f, 2, k])
            low[f, k] = int(np.floor((smallest - origin[k]) / cell))
            high[f, k] = int(np.floor((largest - origin[k]) / cell))
    start = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    for f in range(n):
        for x in range(low[f, 0], high[f, 0] + 1):
            for y in range(low[f, 1], high[f, 1] + 1):
                for z in range(low[f, 2], high[f, 2] + 1):
                    start[(x * shape[1] + y) * shape[2] + z + 1] += 1
    for i in range(1, start.shape[0]):
        start[i] += start[i - 1]
    items = np.empty(start[-1], np.int32)
    fill = start[:-1].copy()
    for f in range(n):
        for x in range(low[f, 0], high[f, 0] + 1):
            for y in range(low[f, 1], high[f, 1] + 1):
                for z in range(low[f, 2], high[f, 2] + 1):
                    c = (x * shape[1] + y) * shape[2] + z
                    items[fill[c]] = f
                    fill[c] += 1
    return start, items
