"""Distances between poses, limits within which poses count as one, and the prior of a start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3
from midastouch_common.pose_metric import ROTATION_SCALE, pose_distance
from midastouch_perception.symmetry.group import Symmetry

ANOTHER, ANOTHER_TURN = 0.01, np.radians(20.0)
"""m, where 1 rad counts as 10 mm, and rad: a hypothesis beyond this distance or angle from the truth is a wrong answer,
so two poses that differ by more are different hypotheses."""

NO_SYMMETRY = Symmetry()


@dataclass(frozen=True)
class Prior:
    """Gaussian prior of a start: pose (4, 4), sigma_t [m] and sigma_r [rad] per axis."""

    pose: np.ndarray
    sigma_t: float
    sigma_r: float

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (6, 6) of [translation, rotation], m^2 and rad^2."""
        return np.diag(np.repeat([self.sigma_t, self.sigma_r], 3) ** 2)

    def widened(self, covariance: np.ndarray) -> Prior:
        """Return the prior with a covariance (6, 6) added, which is the same along all axes."""
        sigma_t, sigma_r = np.sqrt(np.diag(self.covariance + covariance)[[0, 3]])
        return Prior(self.pose, float(sigma_t), float(sigma_r))

    def log_density(self, poses: np.ndarray, floor: float, symmetry: Symmetry) -> np.ndarray:
        """Return log-densities (N,) of poses (N, 4, 4), modulo a symmetry, relative to the peak, at least `floor`."""
        error = se3.log(se3.inverse(self.pose) @ symmetry.nearest(poses, self.pose))
        squared = (error[:, :3] ** 2).sum(axis=1) / self.sigma_t**2 + (error[:, 3:] ** 2).sum(axis=1) / self.sigma_r**2
        return np.maximum(-0.5 * squared, floor)


Differ = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Function that returns which (N,) of poses (N, 4, 4) differ from a pose (4, 4)."""


def another(symmetry: Symmetry = NO_SYMMETRY) -> Differ:
    """Return the function that tests which poses are another hypothesis than a pose, modulo a symmetry."""

    def differ(poses: np.ndarray, pose: np.ndarray) -> np.ndarray:
        nearest = symmetry.nearest(poses, pose)
        chord = 0.5 * np.square(nearest[:, :3, :3] - pose[:3, :3]).sum(axis=(1, 2))  # (2 sin(angle / 2))^2
        return (pose_distance(nearest, pose) > ANOTHER) | (chord > (2.0 * np.sin(0.5 * ANOTHER_TURN)) ** 2)

    return differ


def alike(poses: np.ndarray) -> np.ndarray:
    """Return which (N, N) of poses (N, 4, 4) are one hypothesis, by the limits of `another` and no symmetry."""
    positions, rotations = poses[:, :3, 3], poses[:, :3, :3].reshape(-1, 9)
    position = positions - positions.mean(axis=0)
    norms = np.square(position).sum(axis=1)
    straight = norms[:, None] + norms - 2.0 * position @ position.T
    chord = 3.0 - rotations @ rotations.T  # (2 sin(angle / 2))^2
    near = straight + ROTATION_SCALE**2 * chord <= ANOTHER**2
    return near & (chord <= (2.0 * np.sin(0.5 * ANOTHER_TURN)) ** 2)
