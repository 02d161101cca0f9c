"""Hypotheses on the object that may explain what was measured, and what is known of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from midastouch_common import se3
from midastouch_common.pose_metric import ROTATION_SCALE
from midastouch_perception.symmetry.group import Symmetry

from .alignment import transform_covariance

ANOTHER, ANOTHER_TURN = 0.01, np.radians(20.0)
"""m, where 1 rad counts as 10 mm, and rad: a hypothesis farther than this from the truth, or turned by more, is a wrong
answer, so it is another hypothesis."""

APART = 0.015
"""m: hypotheses on an object of a catalogue that are nearer to each other than this count as one; never less than
`ANOTHER`."""


NO_SYMMETRY = Symmetry()


@dataclass(frozen=True)
class PoseHypothesis:
    """One explanation of the last touches: pose (4, 4) `T_obj_gel` at present; covariance (6, 6) in its own frame;
    probability."""

    pose: np.ndarray
    covariance: np.ndarray
    probability: float

    def moved(self, transform: np.ndarray) -> PoseHypothesis:
        """After the gel moved by `transform` (4, 4)."""
        return replace(self, pose=self.pose @ transform, covariance=transform_covariance(self.covariance, transform))


@dataclass(frozen=True)
class Prior:
    """Where the start was thought to be: pose (4, 4), sigma_t [m] and sigma_r [rad] per axis."""

    pose: np.ndarray
    sigma_t: float
    sigma_r: float

    def log_density(self, poses: np.ndarray, floor: float, symmetry: Symmetry) -> np.ndarray:
        """(N,) nats of poses (N, 4, 4), modulo a symmetry, below the prior's own pose, but no less than `floor`."""
        error = se3.log(se3.inverse(self.pose) @ symmetry.nearest(poses, self.pose))
        squared = (error[:, :3] ** 2).sum(axis=1) / self.sigma_t**2 + (error[:, 3:] ** 2).sum(axis=1) / self.sigma_r**2
        return np.maximum(-0.5 * squared, floor)


def pose_distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Pose distances (...) [m] as the look-up's, of (..., 4, 4) and (..., 4, 4), broadcast."""
    squared = np.square(a - b)
    # the Frobenius norm between two rotations is 2 sqrt(2) sin(angle / 2)
    turned = 0.5 * ROTATION_SCALE**2 * squared[..., :3, :3].sum(axis=(-2, -1))
    return np.sqrt(squared[..., :3, 3].sum(axis=-1) + turned)


Differ = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Which (N,) of poses (N, 4, 4) differ from a pose (4, 4)."""


def another(symmetry: Symmetry = NO_SYMMETRY) -> Differ:
    """What makes a pose another hypothesis, modulo a symmetry."""

    def differ(poses: np.ndarray, pose: np.ndarray) -> np.ndarray:
        nearest = symmetry.nearest(poses, pose)
        chord = 0.5 * np.square(nearest[:, :3, :3] - pose[:3, :3]).sum(axis=(1, 2))  # (2 sin(angle / 2))^2
        return (pose_distance(nearest, pose) > ANOTHER) | (chord > (2.0 * np.sin(0.5 * ANOTHER_TURN)) ** 2)

    return differ


def farther(apart: float, symmetry: Symmetry) -> Differ:
    """What lies farther from each other than `apart` [m], modulo a symmetry."""
    return lambda poses, pose: symmetry.distance(poses, pose) > apart


def far_from(taken: Sequence[np.ndarray], poses: np.ndarray, differ: Differ) -> np.ndarray:
    """(N,) which of the poses (N, 4, 4) differ from all `taken`."""
    far = np.ones(len(poses), bool)
    for each in taken:
        far &= differ(poses, each)
    return far


def distinct(poses: np.ndarray, order: Iterable[int], differ: Differ) -> list[int]:
    """Those of `order`, among poses (N, 4, 4), that differ from all that were chosen before."""
    free, chosen = np.ones(len(poses), bool), []
    for i in order:
        if free[i]:
            chosen.append(int(i))
            free &= differ(poses, poses[i])
    return chosen
