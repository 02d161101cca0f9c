"""Second moment of the whole belief about one pose: the covariance to publish while several places compete.

A mode's own covariance says how well its place is known if it is the right one. Who reads a single pose must also be
told how far away the truth lies if it is another one.
"""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels
from midastouch_perception import se3

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
    place = se3.to_xyzquat(mode.pose)
    moment = kernels.second_moment(
        particles.positions[which], particles.quaternions[which], weights[which], place[:3], place[3:]
    )
    return (1.0 - mass) * mode.covariance + (mass / sampled) * moment
