"""Distances between poses, and of sets of poses from the truth: position, rotation (geodesic on SO(3)), or both in one.

Poses are `T_obj_gel` (..., 4, 4); results are in metres and radians and broadcast. Code that needs a Euclidean distance
for an index or a closed form (the filter's look-up, symmetries) uses the chord 2 sin(angle / 2) in place of the angle;
reported errors never do.
"""

from __future__ import annotations

import numpy as np

from . import se3

ROTATION_SCALE = 0.01
"""alpha [m/rad] of the paper's 6-vectors (section 4.2): 1 rad weighs as much as 10 mm."""


def pose_errors(poses: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compare poses by position and by rotation.

    Parameters
    ----------
    poses, truth : poses (..., 4, 4), which broadcast

    Returns
    -------
    distance, angle : (...)
        Distances [m] and geodesic angles [rad].
    """
    poses, truth = np.asarray(poses, float), np.asarray(truth, float)
    distance = np.linalg.norm(poses[..., :3, 3] - truth[..., :3, 3], axis=-1)
    relative = np.swapaxes(poses[..., :3, :3], -1, -2) @ truth[..., :3, :3]
    return distance, se3.rotation_angle(relative)


def geodesic_distances(poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return distances [m] of position and angle combined, 1 rad counting as alpha metres; continuous over SO(3)."""
    distance, angle = pose_errors(poses, truth)
    return np.hypot(distance, ROTATION_SCALE * angle)


def pose_distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return distances (...) [m] of position and chord combined, 1 rad counting as alpha metres; poses broadcast."""
    squared = np.square(a - b)
    # the Frobenius norm between two rotations is 2 sqrt(2) sin(angle / 2)
    turned = 0.5 * ROTATION_SCALE**2 * squared[..., :3, :3].sum(axis=(-2, -1))
    return np.sqrt(squared[..., :3, 3].sum(axis=-1) + turned)


def six_vectors(poses: np.ndarray) -> np.ndarray:
    """Return the paper's 6-vectors (N, 6) of poses (N, 4, 4): translation [m] and alpha times the log of rotation.

    They jump where the rotation angle passes pi: use them only to compare with the paper, and otherwise
    `geodesic_distances`.
    """
    poses = np.asarray(poses, float)
    rotation_only = se3.make(poses[:, :3, :3], np.zeros(3))
    return np.concatenate([poses[:, :3, 3], ROTATION_SCALE * se3.log(rotation_only)[:, 3:]], axis=1)


def particle_rmse(poses: np.ndarray, truth: np.ndarray, weights: np.ndarray | None = None) -> tuple[float, float]:
    """Return the root mean square error of a particle set: paper equation 3, rotation as geodesic angle.

    Parameters
    ----------
    poses : particles (N, 4, 4)
    truth : true pose (4, 4)
    weights
        (N,), if they are not all the same. The paper resamples at every step, so all its particles have weight 1/N;
        with weights, the result is the expectation of equation 3 over the resampled set.

    Returns
    -------
    translation, rotation : float
        [m] and [rad].
    """
    distance, angle = pose_errors(poses, truth)
    if weights is None:
        weights = np.ones(len(distance))
    weights = np.asarray(weights, float) / np.sum(weights)
    return float(np.sqrt(weights @ distance**2)), float(np.sqrt(weights @ angle**2))


def min_cluster_error(modes: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Return the smallest distance [m] and smallest angle [rad] over the modes (H, 4, 4): paper Eq. 4.

    The two minima may belong to different modes, as in the equation; `closest_mode_error` takes both from one.
    Both are nan when there is no mode.
    """
    if len(modes) == 0:
        return float("nan"), float("nan")
    distance, angle = pose_errors(modes, truth)
    return float(distance.min()), float(angle.min())


def closest_mode_error(modes: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Return distance [m] and angle [rad] from the truth (4, 4) to the mode that is nearest by `geodesic_distances`.

    modes: (K, 4, 4); without any, both results are nan."""
    if len(modes) == 0:
        return float("nan"), float("nan")
    distance, angle = pose_errors(modes, truth)
    best = int(np.argmin(geodesic_distances(modes, truth)))
    return float(distance[best]), float(angle[best])
