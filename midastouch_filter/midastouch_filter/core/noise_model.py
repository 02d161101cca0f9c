"""Assumptions about the noise of poses and maps, and about how often the object is moved (`NoiseModel`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .config import FilterConfig


def _diagonal(translation: float, rotation: float) -> np.ndarray:
    """Return the covariance (6, 6) of a pose in its own frame, by sigmas per axis in m and rad."""
    return np.diag(np.repeat([translation, rotation], 3) ** 2)


# sites of a codebook are some 4 mm apart; turns at a site are 22.5 deg apart, and the sigma is half of that
_BETWEEN_ENTRIES = _diagonal(4e-3, np.radians(12.0))
REGION_WIDTH = 24.5
"""Factor on the covariance of a pose that was aligned to a frame's maps, times their unexplained fraction. With it the
95 % region holds the truth in 95 % of frames; fitted by `midastouch_benchmark/fits/regions.py`."""


LEAST_UNKNOWN, MOST_UNKNOWN = 0.005, 0.96
"""Limits of the probability that none of the known objects is touched: an object that was refused can be believed
again within a few touches."""


@dataclass(frozen=True)
class NoiseModel:
    """Covariances (6, 6) are of [translation, rotation] in a pose's own frame, m^2 and rad^2; evidence is in nats.

    jitter: of one measured sensor pose; an arm reports each with an error that does not last.
    finger_error: of a further finger's pose, given the first one's. drift: of the odometry, for every metre of path.
    map_noise [m]: error of a penetration map; pixels within map_correlation [m] of each other have the same error.
    between_entries: how far the truth lies from the codebook's best entry.
    map_patches: half the number of independent parts of a map; residual_floor: fraction of a map that is never
    explained; see `residual_evidence`. touch_correlation [m]: path over which touches see nearly the same patch, so
    that the evidence of one counts in part; 1 rad counts as 10 mm.
    change, change_lifted: probability that the object was moved to anywhere between two keyframes, and while the
    sensor was lifted.
    prior_floor: lowest log-density relative to the prior's peak, since the prior itself may be wrong.
    elsewhere: squared Mahalanobis distance that 99.9 % of poses of one Gaussian keep below (6 degrees of freedom).
    explained: a pose explains a map if it explains more than this fraction. code_support, contradiction: see
    `object_evidence`.
    """

    jitter: np.ndarray
    finger_error: np.ndarray
    drift: np.ndarray
    map_noise: float
    map_correlation: float
    between_entries: np.ndarray
    touch_correlation: float
    change_lifted: float
    explained: float
    map_patches: float = 8.0
    residual_floor: float = 0.03
    change: float = 1e-3
    prior_floor: float = -12.0
    elsewhere: float = 22.5
    code_support: float = 0.072
    contradiction: float = 1.35

    def residual_evidence(self, residual_ratio: np.ndarray | float) -> np.ndarray:
        """Return the maps' nats, up to a constant, for hypotheses that leave fractions `residual_ratio` unexplained.

        The error of a map is normal, but its scale is unknown and differs from touch to touch: marginalised, the
        likelihood is a power of the residual (Student).
        """
        return -self.map_patches * np.log(np.asarray(residual_ratio) + self.residual_floor)

    def residual_of(self, evidence: np.ndarray) -> np.ndarray:
        """Return the unexplained fraction of a map at which `residual_evidence` has this value."""
        with np.errstate(over="ignore"):
            return np.exp(-evidence / self.map_patches) - self.residual_floor

    def object_evidence(self, code: np.ndarray, contradicted: np.ndarray) -> np.ndarray:
        """Return the touches' nats for an object, against none of the known ones.

        code: nats of their codes for the leading hypothesis on it, against a random touch; only a fraction of them
        counts, since the codes and maps of one surface err alike. contradicted: 0 to 1, whether the hypothesis that
        led before leaves the touches unexplained: they are not the expected ones.
        """
        return self.code_support * code - self.contradiction * contradicted

    @classmethod
    def of(cls, config: FilterConfig) -> NoiseModel:
        """Return the noise model with the configured values."""
        return cls(
            jitter=_diagonal(config.jitter_translation, config.jitter_rotation),
            finger_error=_diagonal(config.finger_translation, config.finger_rotation),
            drift=_diagonal(config.drift_translation, config.drift_rotation),
            map_noise=config.penetration_noise,
            map_correlation=config.penetration_correlation,
            between_entries=_BETWEEN_ENTRIES,
            explained=config.penetration_fit,
            touch_correlation=config.keyframe_spacing,
            change_lifted=config.change_lifted,
        )
