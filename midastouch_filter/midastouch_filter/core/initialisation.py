"""Check of a start (paper section 4.3, "Initialization")."""

from __future__ import annotations

import numpy as np

from midastouch_common.errors import InputError

from .motion_model import Odometry

_WIDEST = 1e3  # m, rad: larger values are mistakes, and float32 is too coarse for them


def checked_prior(pose: np.ndarray, sigma_t: float, sigma_r: float) -> np.ndarray:
    """Return the prior `T_obj_gel` (4, 4) with an orthonormal rotation, if a start can be drawn around it.

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
