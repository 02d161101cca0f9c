"""Poses and the sensor's light in turn: each touch is moved to where the others' light explains it best.

A tracked pose is off by tenths of a millimetre and by a degree, which shifts a contact's outline by several pixels.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from midastouch_common import se3

from ..rendering.renderer import PenetrationRenderer
from .refine import LEVELS, fit_light, lit, looked_at, slope_terms

_ROUNDS = 2
_UNCERTAIN = np.array([5e-4] * 3 + [np.radians(1.0)] * 3)
"""Standard deviations [m, rad] of a tracked pose (paper section 5)."""
_STEP = 0.2  # deviations
_SAYING = 100.0  # pixels of an image that say something of their own: neighbours share shadow and gel


def refine_poses(
    changes: list[np.ndarray], poses: np.ndarray, renderer: PenetrationRenderer
) -> tuple[np.ndarray, list[float]]:
    """The poses T_obj_gel (N, 4, 4) moved within their uncertainty, and the share of each change (H, W, 3) grey levels
    that the joint light then explains. The light is `fit_light`'s, the same for all touches."""
    poses, shares = poses.copy(), [0.0] * len(changes)
    for _ in range(_ROUNDS):
        factors = fit_light(changes, [_shape(pose, renderer) for pose in poses])
        for i, change in enumerate(changes):
            poses[i], shares[i] = _moved(change, poses[i], factors, renderer)
    return poses, shares


def _shape(pose: np.ndarray, renderer: PenetrationRenderer) -> np.ndarray:
    return slope_terms(renderer.render(pose[None])[0], renderer.sensor)


def _moved(
    change: np.ndarray, pose: np.ndarray, factors: np.ndarray, renderer: PenetrationRenderer
) -> tuple[np.ndarray, float]:
    seen = looked_at(change)
    tie = LEVELS * np.sqrt(seen[..., 0].size / _SAYING)  # to the pose as it was tracked

    def unexplained(x: np.ndarray) -> np.ndarray:
        return (seen - lit(_shape(pose @ se3.exp(_UNCERTAIN * x), renderer), factors)).ravel()

    def residual(x: np.ndarray) -> np.ndarray:
        return np.concatenate([unexplained(x), tie * x])

    def jacobian(x: np.ndarray) -> np.ndarray:
        # wide steps: a rendered outline moves by whole pixels
        here = residual(x)
        return np.stack([residual(x + step) - here for step in _STEP * np.eye(6)], axis=1) / _STEP

    found = least_squares(residual, np.zeros(6), jacobian, loss="soft_l1", f_scale=LEVELS, max_nfev=6).x
    explained = 1 - float((unexplained(found) ** 2).sum()) / max(float((seen**2).sum()), 1e-9)
    return pose @ se3.exp(_UNCERTAIN * found), explained
