"""Where the particles start (paper section 4.3, "Initialization")."""

from __future__ import annotations

import numpy as np

from midastouch_perception import se3
from midastouch_perception.errors import InputError

from .motion_model import Odometry

_WIDEST = 1e3  # m, rad; what is farther off is a mistake, and float32 loses it


def checked_prior(pose: np.ndarray, sigma_t: float, sigma_r: float) -> np.ndarray:
    """The prior `T_obj_gel` (4, 4), its rotation orthonormal, if a start can be drawn around it.

    Raises InputError if it is no rigid transform, or if it or a sigma [m, rad] is negative, not finite or absurd.
    """
    try:
        motion = Odometry.from_matrix(pose)
    except ValueError as error:
        raise InputError(f"prior pose: {str(error).replace('odometry', 'the pose')}") from error
    if not motion.distance <= _WIDEST:
        raise InputError(f"prior pose: {motion.distance:.3g} m from the object's origin")
    if not (0 <= sigma_t <= _WIDEST and 0 <= sigma_r <= _WIDEST):
        raise InputError(f"prior pose: sigmas {sigma_t:.3g} m, {sigma_r:.3g} rad must lie between 0 and {_WIDEST:g}")
    return motion.transform


def uniform_entries(n_entries: int, n: int, rng: np.random.Generator) -> np.ndarray:
    """n codebook entries (n,), ascending, over the whole surface, which the codebook covers evenly.

    Stratified: no entry is drawn more than once more than another.
    """
    rounds = -(-n // n_entries)
    return np.sort(np.concatenate([rng.permutation(n_entries) for _ in range(rounds)])[:n])


def gaussian_poses(centre: np.ndarray, sigma_t: float, sigma_r: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """n poses (n, 4, 4) around `centre` (4, 4): sigma_t [m] and sigma_r [rad] per axis (paper section 4.3).

    They lie off the surface; the paper then replaces each by the nearest pose of the codebook.
    """
    noise = np.concatenate([sigma_t * rng.standard_normal((n, 3)), sigma_r * rng.standard_normal((n, 3))], axis=1)
    rotations = se3.exp(noise * [0, 0, 0, 1, 1, 1])[:, :3, :3]
    return se3.make(centre[:3, :3] @ rotations, centre[:3, 3] + noise[:, :3])
