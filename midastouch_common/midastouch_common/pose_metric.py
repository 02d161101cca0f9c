"""How far poses are apart, and distributions of poses from the truth: in position, in rotation (geodesic on SO(3)), and
both in one distance.

Poses are `T_obj_gel` (..., 4, 4); results are in metres and radians and broadcast. Where an index or a closed form
needs a Euclidean distance (the filter's look-up, symmetries) the chord 2 sin(angle / 2) stands for the angle; no error
that is reported is one.
"""

from __future__ import annotations

import numpy as np

from . import se3

ROTATION_SCALE = 0.01
"""alpha [m/rad] of the paper's 6-vectors (section 4.2): 1 rad weighs as much as 10 mm."""


def pose_errors(poses: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (...) [m] and geodesic angles (...) [rad] between poses (..., 4, 4), as far as they broadcast."""
    poses, truth = np.asarray(poses, float), np.asarray(truth, float)
    distance = np.linalg.norm(poses[..., :3, 3] - truth[..., :3, 3], axis=-1)
    relative = np.swapaxes(poses[..., :3, :3], -1, -2) @ truth[..., :3, :3]
    return distance, se3.rotation_angle(relative)


def geodesic_distances(poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Distances [m] in which an angle counts alpha times: continuous over SO(3)."""
    distance, angle = pose_errors(poses, truth)
    return np.hypot(distance, ROTATION_SCALE * angle)


def six_vectors(poses: np.ndarray) -> np.ndarray:
    """The paper's 6-vectors (N, 6) of poses (N, 4, 4): translation [m] and alpha times the log of rotation.

    They jump where the rotation angle passes pi: use them to compare with the paper, `geodesic_distances`
    for everything else.
    """
    poses = np.asarray(poses, float)
    rotation_only = se3.make(poses[:, :3, :3], np.zeros(3))
    return np.concatenate([poses[:, :3, 3], ROTATION_SCALE * se3.log(rotation_only)[:, 3:]], axis=1)


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
