"""Noise that refinement, smoothing and identification assume of poses, maps and codes (`NoiseModel`), and limits of
their work (`Effort`). The noise of the motion is in `motion_model.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .config import FilterConfig


def _diagonal(translation: float, rotation_deg: float) -> np.ndarray:
    """Covariance (6, 6) of a pose in its own frame, by sigmas per axis in m and deg."""
    return np.diag(np.repeat([translation, np.radians(rotation_deg)], 3) ** 2)


# sites of a codebook are some 4 mm apart, and the turns of a site 22.5 deg, of which this is half
_BETWEEN_ENTRIES = _diagonal(4e-3, 12.0)
_MODE_FLOOR = _diagonal(2e-4, 0.3)


@dataclass(frozen=True)
class NoiseModel:
    """Covariances (6, 6) are of [translation, rotation] in a pose's own frame, m^2 and rad^2; evidence is in nats.

    jitter: of one measured sensor pose; an arm reports each with an error of its own that does not stay.
    finger_error: of a further finger's pose, given the first one's.
    map_noise [m]: error of a penetration map; pixels within map_correlation [m] of each other have the same error.
    between_entries: how far the truth lies from the codebook's best entry; mode_floor: no mode is surer than this.
    map_patches: half the number of independent parts of a map; residual_floor: fraction of a map that is never
    explained; see `residual_evidence`. touch_correlation [m]: path over which touches see nearly the same patch, so
    that the evidence of one counts in part; 1 rad counts as 10 mm.
    change, change_lifted: probability that the object was moved between two keyframes, and while the sensor was lifted.
    prior_floor: lowest log-density relative to the prior's peak, since the prior itself may be wrong.
    refuted: log-odds below which a hypothesis is dropped; settled: probability from which on comparisons are rare.
    code_margin: how far a right hypothesis may fall behind the best one by its codes.
    elsewhere: squared Mahalanobis distance that 99.9 % of poses of one Gaussian keep below (6 degrees of freedom).
    decisive: evidence by which one of two optima is the better one, with as much certainty.
    Between objects: between_objects, fraction of the evidence of touches that holds between hypotheses on different
    objects, whose maps err together; foreign_residual, the residual ratio of a
    hypothesis that speaks neither for its object nor against it; innovation_cost, evidence that each unit of
    squared Mahalanobis innovation costs a hypothesis; alone_residual and alone_innovation_cost, the same where only
    one object is known; see `object_evidence`.
    """

    jitter: np.ndarray
    finger_error: np.ndarray
    map_noise: float
    map_correlation: float
    between_entries: np.ndarray
    mode_floor: np.ndarray
    map_patches: float = 5.0
    residual_floor: float = 0.024
    touch_correlation: float = 0.02
    change: float = 1e-3
    change_lifted: float = 0.2
    prior_floor: float = -12.0
    refuted: float = -12.0
    settled: float = 0.995
    code_margin: float = 6.0
    elsewhere: float = 22.5
    decisive: float = math.log(999.0)
    between_objects: float = 0.135
    foreign_residual: float = 0.48
    innovation_cost: float = 1.37
    alone_residual: float = 0.186
    alone_innovation_cost: float = 0.255

    def residual_evidence(self, residual_ratio: np.ndarray | float) -> np.ndarray:
        """Nats, up to a constant, that maps speak for hypotheses which leave the fractions `residual_ratio` of them
        unexplained.

        The error of a map is normal, of a scale that differs from touch to touch and is not known: marginalised, the
        likelihood is a power of the residual (Student).
        """
        return -self.map_patches * np.log(np.asarray(residual_ratio) + self.residual_floor)

    def evidence_slope(self, residual_ratio: float) -> float:
        """Nats by which `residual_evidence` falls for each unit of the residual ratio, there."""
        return self.map_patches / (residual_ratio + self.residual_floor)

    def object_evidence(self, residual_ratio: np.ndarray, squared_innovation: np.ndarray, objects: int) -> np.ndarray:
        """Nats that touches speak for hypotheses on an object of a catalogue of so many, against it being none of them.

        residual ratio as above; squared_innovation: squared Mahalanobis distances from where the path led to where the
        maps fit, which tell a surface of another curvature: its maps fit, but not one after the other.
        """
        foreign, cost = self.foreign_residual, self.innovation_cost
        if objects == 1:  # no other one tells how well a further object would explain the touches
            foreign, cost = self.alone_residual, self.alone_innovation_cost
        fit = self.residual_evidence(residual_ratio) - self.residual_evidence(foreign)
        return self.between_objects * (fit - cost * np.minimum(squared_innovation, self.elsewhere))

    @classmethod
    def of(cls, config: FilterConfig) -> NoiseModel:
        """With the configured values of what differs between machines."""
        return cls(
            jitter=config.jitter,
            finger_error=config.finger_error,
            map_noise=config.penetration_noise,
            map_correlation=config.penetration_correlation,
            between_entries=_BETWEEN_ENTRIES,
            mode_floor=_MODE_FLOOR,
        )


@dataclass(frozen=True)
class Effort:
    """How much work the fine stage does for its answer.

    Alignment of modes:
    starts: particles from which a mode wider than the codebook's spacing is aligned besides its mean.

    Re-evaluation of the last touches:
    fewest: touches that the first one needs. anew: further touches until the next one; this interval doubles each time,
    up to `seldom` while pose hypotheses compete and `rarely` once they do not.
    shortlist: best entries of each touch, of all fingers, that become candidates. These come from `sieve` touches, the
    newest and ever sparser ones before it, are scored on those first, and the best `kept` of them on all.
    With several fingers, the best `turned` candidates are turned by the angles `turns` [rad] to where all fit: codebook
    entries are some 20 deg apart, which moves a further finger by centimetres.
    carried: hypotheses of the last comparison that are compared again, whether codes bring them up or not.
    lookups_per_second (of candidates) and alignments_per_second bound what it takes of a core; frames farther apart
    than `longest` [s] count as that. `alignments` bound the competitors that are followed in all.
    settled_after: touches after which a hypothesis' rotation is known well enough to say where further fingers are.
    """

    starts: int = 4
    fewest: int = 2
    anew: int = 1
    seldom: int = 4
    rarely: int = 12
    shortlist: int = 80
    sieve: int = 5
    kept: int = 200
    turned: int = 50
    turns: tuple[float, ...] = (np.radians(10.0), np.radians(5.0))
    carried: int = 16
    lookups_per_second: int = 150_000
    alignments: int = 1500
    alignments_per_second: int = 1_800
    longest: float = 0.05
    settled_after: int = 3
