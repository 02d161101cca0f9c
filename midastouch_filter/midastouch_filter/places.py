"""Places on the object that may explain what was felt, and what is known of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from midastouch_perception import se3
from midastouch_perception.pose_metric import ROTATION_SCALE

from .joint_alignment import transform_covariance

APART = 0.015
"""m: places nearer than this are the same one; 1 rad counts as 10 mm."""


@dataclass(frozen=True)
class Place:
    """One explanation of the last touches: pose (4, 4) `T_obj_gel` at present; covariance (6, 6) in its own frame;
    probability."""

    pose: np.ndarray
    covariance: np.ndarray
    probability: float

    def moved(self, transform: np.ndarray) -> Place:
        """After the gel moved by `transform` (4, 4)."""
        return replace(self, pose=self.pose @ transform, covariance=transform_covariance(self.covariance, transform))


@dataclass(frozen=True)
class Prior:
    """Where the start was thought to be: pose (4, 4), sigma_t [m] and sigma_r [rad] per axis."""

    pose: np.ndarray
    sigma_t: float
    sigma_r: float

    def log_density(self, poses: np.ndarray, floor: float) -> np.ndarray:
        """(N,) nats of poses (N, 4, 4) below the prior's own pose, but no less than `floor`."""
        error = se3.log(se3.inverse(self.pose) @ poses)
        squared = (error[:, :3] ** 2).sum(axis=1) / self.sigma_t**2 + (error[:, 3:] ** 2).sum(axis=1) / self.sigma_r**2
        return np.maximum(-0.5 * squared, floor)


def pose_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Pose distance [m] as the look-up's, of (4, 4) and (4, 4)."""
    squared = np.square(a - b)
    # the Frobenius norm between two rotations is 2 sqrt(2) sin(angle / 2)
    return math.sqrt(squared[:3, 3].sum() + 0.5 * ROTATION_SCALE**2 * squared[:3, :3].sum())


def is_apart(pose: np.ndarray, others: Sequence[np.ndarray]) -> bool:
    """Whether a pose (4, 4) is another place than each of the others."""
    return all(pose_distance(pose, other) > APART for other in others)
