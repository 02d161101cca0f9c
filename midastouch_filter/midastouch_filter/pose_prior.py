"""What a PoseWithCovariance from a user or a camera says to the filter: a spread it can start with."""

from __future__ import annotations

import math

import numpy as np

# Widest start: the paper's, appendix C (sigma_t = diagonal / 3, sigma_r = 60 degrees at beta = 1)
_WIDEST_ROTATION = math.radians(60.0)
# A prior sharper than this would put all particles onto one codebook entry.
_SHARPEST_TRANSLATION = 5e-4
_SHARPEST_ROTATION = math.radians(1.0)


def spread_of(covariance: np.ndarray, diagonal: float) -> tuple[float, float]:
    """(sigma_t [m], sigma_r [rad]) for `ParticleFilter.initialise_gaussian`.

    covariance (6, 6): REP 103 order. diagonal [m]: of the object. A zero variance means "unknown", not
    "certain": RViz's 2D Pose Estimate leaves z, roll and pitch at zero. The largest variance counts for all
    axes, and nothing is wider than the object or than 60 degrees (RViz's 0.5 m says nothing about a cup).
    """
    variances = np.diagonal(covariance)
    return (
        _spread(variances[:3], _SHARPEST_TRANSLATION, diagonal / 3),
        _spread(variances[3:], _SHARPEST_ROTATION, _WIDEST_ROTATION),
    )


def spread_at_lever(sigma_t: float, sigma_r: float, lever: float) -> float:
    """sigma_t [m] at a point `lever` metres from where the pose is given: rotation moves it too."""
    return math.hypot(sigma_t, sigma_r * lever)


def _spread(variances: np.ndarray, sharpest: float, widest: float) -> float:
    if (variances <= 0).any():
        return widest
    return float(np.clip(np.sqrt(variances.max()), min(sharpest, widest), widest))
