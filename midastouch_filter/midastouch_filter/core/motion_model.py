"""Motion of the sensor between two frames, and the check that it can be used."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.pose_metric import ROTATION_SCALE

_ORTHONORMAL = 1e-3  # largest deviation of R^T R from I that still counts as a rotation


@dataclass(frozen=True)
class Odometry:
    """Motion of the sensor between two frames, `T_gel(t-1)_gel(t)`.

    transform (4, 4), its rotation orthonormal to rounding; row (7,) float32, the same as position and quaternion;
    distance m; angle rad.
    """

    transform: np.ndarray
    row: np.ndarray
    distance: float
    angle: float

    @classmethod
    def from_matrix(cls, transform: np.ndarray) -> Odometry:
        """Check odometry (4, 4); raises ValueError with the reason if it is no finite rigid transform."""
        transform = np.ascontiguousarray(transform, float)
        if transform.shape != (4, 4):
            raise ValueError(f"odometry of shape {transform.shape} instead of (4, 4)")
        if not np.isfinite(transform).all():
            raise ValueError("odometry is not finite")
        error, row, transform = kernels.decompose(transform)
        if not error < _ORTHONORMAL:
            raise ValueError("odometry is not a rigid transform")
        distance = math.hypot(*row[:3])
        angle = 2 * math.atan2(math.sqrt(row[3] ** 2 + row[4] ** 2 + row[5] ** 2), abs(row[6]))
        with np.errstate(over="ignore"):  # a jump that is never applied
            return cls(transform, row.astype(np.float32), distance, angle)

    @property
    def path(self) -> float:
        """Distance moved and turned together [m]; 1 rad counts as 10 mm."""
        return self.distance + ROTATION_SCALE * self.angle
