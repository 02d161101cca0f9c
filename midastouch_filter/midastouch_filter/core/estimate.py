"""Answer of one step of the filter: modes with weight, pose and covariance, and a status."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .state import Status


@dataclass(frozen=True)
class Mode:
    """One mode of the belief.

    Attributes
    ----------
    weight : probability in [0, 1]
    pose : `T_obj_gel` (4, 4)
    covariance
        (6, 6) in REP-103 order, [x y z, rotation about X, Y, Z], about the fixed axes of the object frame: m^2, m rad,
        rad^2.
    n
        Number of its hypotheses.
    """

    weight: float
    pose: np.ndarray
    covariance: np.ndarray
    n: int

    @property
    def spread_translation(self) -> float:
        """RMS distance [m] from the truth to the pose, if the mode is right."""
        c = self.covariance
        return math.sqrt(c[0, 0] + c[1, 1] + c[2, 2])

    @property
    def spread_rotation(self) -> float:
        """RMS angle [rad] from the truth to the pose, if the mode is right."""
        c = self.covariance
        return math.sqrt(c[3, 3] + c[4, 4] + c[5, 5])


@dataclass(frozen=True)
class Estimate:
    """Answer of one step.

    Attributes
    ----------
    modes
        Heaviest first; none while uninitialised.
    status
        How far to trust the answer, and why.
    covariance
        (6, 6) of the whole belief about the dominant mode's pose, in the order and axes of `Mode.covariance`: while
        several hypotheses compete, the distance between them is part of it. None while uninitialised.
    """

    modes: list[Mode]
    status: Status
    covariance: np.ndarray | None = None

    @property
    def pose(self) -> np.ndarray | None:
        """`T_obj_gel` (4, 4) of the dominant mode; None while uninitialised."""
        return self.modes[0].pose if self.modes else None
