"""Errors of pose distributions against the ground truth: Eq. 3 and Eq. 4 of the paper, single touch.

Poses are `T_obj_gel` (4, 4) or (N, 4, 4); results are in metres and radians.
"""

from __future__ import annotations

import numpy as np

from midastouch_common.pose_metric import geodesic_distances, pose_errors


def particle_rmse(poses: np.ndarray, truth: np.ndarray, weights: np.ndarray | None = None) -> tuple[float, float]:
    """Root mean square error of a particle set, [m] and [rad]: paper Eq. 3, rotation as geodesic angle.

    The paper resamples at every step, so its particles weigh the same. Ours need not; `weights` (N,) then
    replace 1/N, which is the expectation of Eq. 3 over the resampled set.
    """
    distance, angle = pose_errors(poses, truth)
    if weights is None:
        weights = np.ones(len(distance))
    weights = np.asarray(weights, float) / np.sum(weights)
    return float(np.sqrt(weights @ distance**2)), float(np.sqrt(weights @ angle**2))


def min_cluster_error(modes: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Smallest distance [m] and smallest angle [rad] over the modes (H, 4, 4): paper Eq. 4.

    The two minima are taken apart, as the equation has it; `closest_mode_error` keeps them together.
    Both are nan when there is no mode.
    """
    if len(modes) == 0:
        return float("nan"), float("nan")
    distance, angle = pose_errors(modes, truth)
    return float(distance.min()), float(angle.min())


def closest_mode_error(modes: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Distance [m] and angle [rad] to the truth (4, 4) of the nearest of modes (K, 4, 4) in the 6-D sense; nan without
    modes."""
    if len(modes) == 0:
        return float("nan"), float("nan")
    distance, angle = pose_errors(modes, truth)
    best = int(np.argmin(geodesic_distances(modes, truth)))
    return float(distance[best]), float(angle[best])
