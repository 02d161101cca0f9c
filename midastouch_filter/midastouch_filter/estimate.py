"""What a step of the filter answers: modes with mass, mean pose and covariance, and a status."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from . import quaternion
from .modes import Moments
from .state import Status


@dataclass(frozen=True)
class Mode:
    """One hypothesis: its weight in [0, 1], pose `T_obj_gel` (4, 4), covariance (6, 6) and number of particles n.

    The covariance is in REP-103 order, [x y z, rotation about X, Y, Z], about the fixed axes of the object frame:
    m^2, m rad, rad^2.
    """

    weight: float
    pose: np.ndarray
    covariance: np.ndarray
    n: int

    @property
    def spread_translation(self) -> float:
        """RMS distance [m] of the mode's particles to its mean."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))

    @property
    def spread_rotation(self) -> float:
        """RMS angle [rad] of the mode's particles to its mean."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))


@dataclass(frozen=True)
class Estimate:
    """Answer of one step.

    modes, heaviest first (none while uninitialised); status; covariance (6, 6) of the whole belief about the dominant
    mode's pose, in the order and axes of `Mode.covariance`: while several places compete, the distance between them is
    part of it. None while uninitialised.
    """

    modes: list[Mode]
    status: Status
    covariance: np.ndarray | None = None

    @property
    def pose(self) -> np.ndarray | None:
        """`T_obj_gel` (4, 4) of the dominant mode; None while uninitialised."""
        return self.modes[0].pose if self.modes else None


def modes_from_moments(m: Moments) -> list[Mode]:
    """Mean and covariance of each mode.

    The mean rotation is Markley's (2007): the largest eigenvector of the mean of q q^T. A deviation is the vector
    2 vec(q mean^-1), of length 2 sin(angle / 2): the rotation vector up to third order, and finite for any angle.
    """
    poses, covariance = _gaussians(
        m.reference, m.position, m.position_square, m.quaternion, m.quaternion_square, m.cross
    )
    return [Mode(*mode) for mode in zip(m.mass.tolist(), poses, covariance, m.count.tolist(), strict=True)]


@numba.njit(cache=True, nogil=True)
def _gaussians(reference, position, position_square, quaternion_mean, quaternion_square, cross):
    """Poses (m, 4, 4) and covariances (m, 6, 6) from the arrays of `Moments`."""
    poses, covariance = np.zeros((len(reference), 4, 4)), np.empty((len(reference), 6, 6))
    for k in range(len(reference)):
        mean = quaternion.principal_axis(quaternion_square[k])
        if np.dot(mean, reference[k, 3:]) < 0:
            mean = -mean
        x, y, z, w = mean
        # vec(q * conj(mean)) is linear in q
        linear = 2 * np.array([[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z]])
        poses[k, :3, :3] = quaternion.to_matrix(mean)
        poses[k, :3, 3] = reference[k, :3] + position[k]
        poses[k, 3, 3] = 1.0
        covariance[k, :3, :3] = position_square[k] - np.outer(position[k], position[k])
        covariance[k, 3:, 3:] = linear @ quaternion_square[k] @ linear.T
        covariance[k, :3, 3:] = (cross[k] - np.outer(position[k], quaternion_mean[k])) @ linear.T
        covariance[k, 3:, :3] = covariance[k, :3, 3:].T
        for a in range(6):
            # rounding can leave a variance a few 1e-19 below zero
            covariance[k, a, a] = max(covariance[k, a, a], 0.0)
    return poses, covariance
