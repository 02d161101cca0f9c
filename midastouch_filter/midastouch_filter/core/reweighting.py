"""Equation 2 of the paper, made a calibrated likelihood ratio, for all fingers; then the weights are normalised."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .belief import Belief
from .config import FilterConfig
from .fingers import Finger
from .recovery import LikelihoodTrend


class Reweighting:
    """Weighs particles by what fingers feel, and watches how well that was predicted.

    Args: config; outlier: share of touches that match nothing; pool(belief, name, log_ratio): changes what the code of
    a touching finger says of each particle before it is used.
    Attributes: trend of the likelihood.
    """

    def __init__(self, config: FilterConfig, outlier: float, pool: Callable[[Belief, str, np.ndarray], None]):
        self._config, self._outlier, self._pool = config, outlier, pool
        self.restart()

    def restart(self) -> None:
        """The particles were drawn anew."""
        self.trend = LikelihoodTrend(self._config, self._outlier)

    def __call__(self, belief: Belief, felt: list[Finger], codebook_distance: np.ndarray) -> bool:
        """Multiply the weights by every finger's tempered likelihood ratio; False, with nothing done, if none survives.

        felt: one or more fingers, of which one touches; codebook_distance (N,) [m], as from `Belief.look_up`.
        """
        evidence = tempered = None
        for finger in felt:
            log_ratio = finger.log_ratio(belief.particles, codebook_distance)
            if finger.touch.in_contact:
                self._pool(belief, finger.name, log_ratio)
            power = finger.tempering * log_ratio
            evidence = log_ratio if evidence is None else evidence + log_ratio
            tempered = power if tempered is None else tempered + power
        likelihood, alive = belief.reweigh(evidence, tempered)
        exponents = [finger.tempering for finger in felt if finger.touch.in_contact]
        self.trend.update(likelihood / len(exponents), max(exponents))
        return alive
