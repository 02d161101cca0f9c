"""Sparse voxels: integer coordinates in order, the coarser voxels that hold them, and who neighbours whom.

Conventions of MinkowskiEngine, for which the weights were made: a coarse coordinate is the fine one halved and
rounded down; the offsets of a cubic kernel run with x fastest.
"""

from __future__ import annotations

import math

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError

_MARGIN = 2  # voxels kept free around the cloud, so that no kernel up to 5 wide reaches into another row


class Voxels:
    """Occupied voxels of one level.

    Attributes: coordinates (N, 3) int64, each voxel once, sorted with x fastest, in units of this level's voxels.
    """

    def __init__(self, coordinates: np.ndarray):
        coordinates = np.asarray(coordinates, np.int64)
        low = coordinates.min(axis=0) - _MARGIN
        size = coordinates.max(axis=0) - low + 1 + _MARGIN
        if math.prod(int(s) for s in size) >= 2**62:
            raise InputError(f"voxel grid of {' x '.join(map(str, size))} is too fine; use a larger voxel size")
        self._width, self._plane = size[0], size[0] * size[1]
        keys = (coordinates - low) @ np.array([1, self._width, self._plane])
        self._keys, first, self._inverse = np.unique(keys, return_index=True, return_inverse=True)
        self.coordinates = coordinates[first]

    def coarser(self) -> tuple[Voxels, np.ndarray, np.ndarray]:
        """Voxels of twice the size; for each voxel here the row of the one that holds it (N,), and which of its eight
        parts (N,) it is, x + 2 y + 4 z."""
        voxels = Voxels(self.coordinates >> 1)
        return voxels, voxels._inverse, (self.coordinates & 1) @ np.array([1, 2, 4])

    def neighbours(self, radius: int) -> np.ndarray:
        """Rows ((2 radius + 1)^3, N) int32 of the voxels at each offset of a cubic kernel; -1 where there is none."""
        return kernels.neighbours(self._keys, self._width, self._plane, radius)


def quantise(cloud: np.ndarray, voxel_size: float) -> Voxels:
    """Voxels of edge `voxel_size` occupied by a cloud (N, 3), N >= 1, both in the same unit."""
    return Voxels(np.floor(cloud / np.float32(voxel_size)))
