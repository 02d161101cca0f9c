"""What a step of the filter answers: modes with mass, mean pose and covariance, and a status."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels

from .modes import Moments
from .state import Status

_KNOWN_FRACTION = 0.5  # fraction of its first standard deviation below which an axis counts as known


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
        c = self.covariance
        return math.sqrt(c[0, 0] + c[1, 1] + c[2, 2])

    @property
    def spread_rotation(self) -> float:
        """RMS angle [rad] of the mode's particles to its mean."""
        c = self.covariance
        return math.sqrt(c[3, 3] + c[4, 4] + c[5, 5])


@dataclass(frozen=True)
class Calibration:
    """What is known of mount and clock.

    mount (4, 4), `T_true_gel_reported`: the gel frame as the mount reports it, in the true one; clock [s], by which the
    arm's poses are late; covariance (7, 7) of [mount, own frame: m, rad; clock: s]; prior (7,), standard deviations
    before anything was measured; touches that were used.
    """

    mount: np.ndarray
    clock: float
    covariance: np.ndarray
    prior: np.ndarray
    touches: int

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations (7,): m, rad, s."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def known(self) -> np.ndarray:
        """Which (7,) are known much better than before."""
        return self.sigma < _KNOWN_FRACTION * self.prior


@dataclass(frozen=True)
class Estimate:
    """Answer of one step.

    modes, heaviest first (none while uninitialised); status; covariance (6, 6) of the whole belief about the dominant
    mode's pose, in the order and axes of `Mode.covariance`: while several hypotheses compete, the distance between them
    is part of it. None while uninitialised. calibration: what is known of mount and clock, None if nothing asks.
    """

    modes: list[Mode]
    status: Status
    covariance: np.ndarray | None = None
    calibration: Calibration | None = None

    @property
    def pose(self) -> np.ndarray | None:
        """`T_obj_gel` (4, 4) of the dominant mode; None while uninitialised."""
        return self.modes[0].pose if self.modes else None


def modes_from_moments(m: Moments) -> list[Mode]:
    """Mean and covariance of each mode.

    The mean rotation is Markley's (2007): the largest eigenvector of the mean of q q^T. A deviation is the vector
    2 vec(q mean^-1), of length 2 sin(angle / 2): the rotation vector up to third order, and finite for any angle.
    """
    poses, covariance = kernels.gaussians(m.reference, m.square)
    return [Mode(*mode) for mode in zip(m.mass.tolist(), poses, covariance, m.count.tolist(), strict=True)]
