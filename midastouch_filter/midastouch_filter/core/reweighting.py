"""Equation 2 of the paper, made a calibrated likelihood ratio, for all fingers; and recovery by codes alone.

The unnormalised likelihood is watched. Without penetration maps, particles are injected when it collapses: as in
augmented Monte Carlo localisation (Thrun, Burgard and Fox 2005, section 8.3.5), but on calibrated log-likelihood
ratios, which have an absolute zero (chance) and an absolute worst, log(outlier).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .belief import Belief
from .fingers import Finger
from .gates import Gates
from .initialisation import ParticleSource

_COLLAPSE = 0.45  # fraction of log(outlier) beyond which the short average counts as collapsed
_SLOW = 0.04  # rate of the long average


class LikelihoodTrend:
    """Long and short running averages of the log-likelihood ratio that the particles predicted.

    Attributes: short, long [nats]; 0 is what particles spread at random would predict. Single touches count at
    most as twice the worst ratio and at least as half of it with the sign turned: one impossible touch must not
    poison the averages, and praise from long ago must not delay the alarm.
    """

    def __init__(self, outlier: float):
        self._worst = math.log(outlier)
        self.short = self.long = 0.0

    def update(self, log_likelihood: float, tempering: float) -> None:
        """Add one touch, counted as `tempering` of an independent one."""
        value = min(max(log_likelihood, 2 * self._worst), -0.5 * self._worst)
        self.short += tempering * (value - self.short)
        self.long += _SLOW * tempering * (value - self.long)

    def explained(self) -> None:
        """The penetration map itself fits the belief: whatever the codes say, the particles are not lost."""
        self.short = max(self.short, 0.0)

    @property
    def support(self) -> float:
        """Short average as a fraction of the worst ratio: <= 0 at or above chance, 1 at log(outlier)."""
        return self.short / self._worst


class Reweighting:
    """Weighs particles by what fingers measure, and watches how well that was predicted.

    Args: outlier: fraction of touches that match nothing; pool(belief, name, log_ratio): changes what the code of a
    touching finger says of each particle before it is used.
    Attributes: trend of the likelihood.
    """

    def __init__(self, outlier: float, pool: Callable[[Belief, str, np.ndarray], None]):
        self._outlier, self._pool = outlier, pool
        self.restart()

    def restart(self) -> None:
        """The particles were drawn anew."""
        self.trend = LikelihoodTrend(self._outlier)

    def __call__(self, belief: Belief, measured: list[Finger], codebook_distance: np.ndarray) -> bool:
        """Multiply the weights by every finger's tempered likelihood ratio; False, with nothing done, if none survives.

        measured: one or more fingers, of which one touches; codebook_distance (N,) [m], as from `Belief.look_up`.
        """
        evidence = tempered = None
        for finger in measured:
            log_ratio = finger.log_ratio(belief.particles, codebook_distance)
            if finger.touch.in_contact:
                self._pool(belief, finger.name, log_ratio)
            power = finger.tempering * log_ratio
            evidence = log_ratio if evidence is None else evidence + log_ratio
            tempered = power if tempered is None else tempered + power
        likelihood, alive = belief.reweigh(evidence, tempered)
        exponents = [finger.tempering for finger in measured if finger.touch.in_contact]
        self.trend.update(likelihood / len(exponents), max(exponents))
        return alive


class Recovery:
    """Puts matches of the present touch in place of some particles, once the likelihood has collapsed.

    Args: source of the matches; gates, which counts what is injected; largest, fraction of the particles at a time.
    """

    def __init__(self, source: ParticleSource, gates: Gates, largest: float):
        self._source, self._gates, self._largest = source, gates, largest

    def fraction(self, trend: LikelihoodTrend) -> float:
        """Of particles to replace: 0 unless the short average has collapsed.

        It must also have fallen below the long average: touches that never fitted (a wrong mesh, a sensor
        unlike the training's) are no reason to go on guessing.
        """
        if trend.support < _COLLAPSE or trend.short > trend.long:
            return 0.0
        return self._largest * (1.0 - math.exp(trend.short - trend.long))

    def __call__(self, belief: Belief, finger: Finger, fraction: float) -> None:
        """Replace this fraction of equally weighted particles by matches of the finger's touch; 0: none."""
        if fraction > 0:
            self._gates.count("injected", self._source.inject(belief.particles, finger, fraction))
