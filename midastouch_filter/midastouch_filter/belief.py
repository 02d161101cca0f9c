"""Second moment of the whole belief about one pose: the covariance to publish while several places compete.

A mode's own covariance says how well its place is known if it is the right one. Who reads a single pose must also be
told how far away the truth lies if it is another one.
"""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels

from .estimate import Mode
from .particles import Particles

_SAMPLE = 4096  # particles that the other places are judged by


def covariance_about(mode: Mode, members: np.ndarray, particles: Particles, weights: np.ndarray) -> np.ndarray:
    """Covariance (6, 6) of the belief about the dominant mode's pose, in the order and axes of `Mode.covariance`.

    members (N,) int32: the mode of each particle, 0 for this one; weights (N,), sum 1. The part of the others is the
    second moment of position and rotation vector about the mode's pose; the mode's own part is its covariance.
    """
    place = kernels.decompose(mode.pose)[1]
    mass, moment = kernels.second_moment(particles.positions, particles.quaternions, weights, members, place, _SAMPLE)
    return (1.0 - mass) * mode.covariance + mass * moment
