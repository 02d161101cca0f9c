"""Values known at places of an object, blended over the surface points of a picture."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

_NEIGHBOURS = 12


class PlaceBlend:
    """Blends between the nearest of the places (C, 3) m for surface points (P, 3) m.

    Which those are, and with what weight, is found once for any number of values.
    """

    def __init__(self, places: np.ndarray, points: np.ndarray):
        distance, index = cKDTree(places).query(points, min(_NEIGHBOURS, len(places)), workers=-1)
        self._index = index.reshape(len(points), -1)
        distance = distance.reshape(len(points), -1)
        weight = np.exp(-4 * (distance / np.maximum(distance[:, -1:], 1e-9)) ** 2)
        self._weight = weight / weight.sum(axis=1, keepdims=True)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Values (P, ...) at the points for those at the places, (C, ...)."""
        return np.einsum("pk,pk...->p...", self._weight, values[self._index])
