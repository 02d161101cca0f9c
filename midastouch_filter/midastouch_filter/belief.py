"""Second moment of the whole belief about one pose: the covariance to publish while several places compete.

A mode's own covariance says how well its place is known if it is the right one. Who reads a single pose must also be
told how far away the truth lies if it is another one.
"""

from __future__ import annotations

import numba
import numpy as np

from . import quaternion
from .estimate import Mode
from .particles import Particles

_SAMPLE = 4096  # particles that the other places are judged by: every n-th, which is systematic sampling


def covariance_about(mode: Mode, others: np.ndarray, particles: Particles, weights: np.ndarray) -> np.ndarray:
    """Covariance (6, 6) of the belief about a mode's pose, in the order and axes of `Mode.covariance`.

    others (N,) bool: particles outside the mode; weights (N,), sum 1. Their part is the second moment of position and
    rotation vector about the mode's pose; the mode's own part is its covariance.
    """
    which = np.flatnonzero(others)
    mass = float(weights[which].sum())
    if not mass:
        return mode.covariance
    which = which[:: max(len(which) // _SAMPLE, 1)]
    sampled = float(weights[which].sum())
    if not sampled:
        return mode.covariance
    turn = quaternion.from_matrix(mode.pose[:3, :3])
    moment = _second_moment(
        particles.positions[which], particles.quaternions[which], weights[which], mode.pose[:3, 3], turn
    )
    return (1.0 - mass) * mode.covariance + (mass / sampled) * moment


@numba.njit(cache=True, nogil=True)
def _second_moment(positions, quaternions, weights, centre, turn):
    """Sum (6, 6) of w d d', d = (position - centre, rotation vector from `turn` (4,)), fixed axes."""
    out = np.zeros((6, 6))
    d = np.empty(6)
    for i in range(len(weights)):
        for a in range(3):
            d[a] = positions[i, a] - centre[a]
        x, y, z, w = quaternion.multiply(
            quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3],
            -turn[0], -turn[1], -turn[2], turn[3],
        )  # fmt: skip
        d[3], d[4], d[5] = quaternion.rotation_vector(x, y, z, w)
        for a in range(6):
            for b in range(6):
                out[a, b] += weights[i] * d[a] * d[b]
    return out
