"""What a step of the filter answers: modes with mass, mean pose and covariance, and a status."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from midastouch_perception import se3

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
    if not len(m.mass):
        return []
    mean = np.linalg.eigh(m.quaternion_square)[1][:, :, -1]
    mean *= np.where(np.einsum("mi,mi->m", mean, m.reference[:, 3:]) < 0, -1.0, 1.0)[:, None]
    # vec(q * conj(mean)) is linear in q: (3, 4) matrices
    x, y, z, w = mean.T
    linear = 2 * np.stack(
        [np.stack([w, -z, y, -x], -1), np.stack([z, w, -x, -y], -1), np.stack([-y, x, w, -z], -1)], axis=1
    )
    covariance = np.empty((len(mean), 6, 6))
    covariance[:, :3, :3] = m.position_square - m.position[:, :, None] * m.position[:, None, :]
    covariance[:, 3:, 3:] = linear @ m.quaternion_square @ np.swapaxes(linear, 1, 2)
    cross = (m.cross - m.position[:, :, None] * m.quaternion[:, None, :]) @ np.swapaxes(linear, 1, 2)
    covariance[:, :3, 3:] = cross
    covariance[:, 3:, :3] = np.swapaxes(cross, 1, 2)
    # rounding can leave a variance a few 1e-19 below zero
    diagonal = np.einsum("mii->mi", covariance)
    np.maximum(diagonal, 0.0, out=diagonal)
    poses = se3.from_xyzquat(np.concatenate([m.reference[:, :3] + m.position, mean], axis=1))
    return [Mode(*mode) for mode in zip(m.mass.tolist(), poses, covariance, m.count.tolist(), strict=True)]
