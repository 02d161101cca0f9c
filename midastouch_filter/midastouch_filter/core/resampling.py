"""To how many particles the belief is resampled (paper section 4.3; KLD sampling, appendix C and Fox 2001)."""

from __future__ import annotations

import math

import numpy as np

import midastouch_kernels as kernels

from .belief import Belief
from .config import FilterConfig
from .modes import Regions


def log_sum_exp(values: np.ndarray) -> float:
    """log(sum(exp(values))) of values (N,), without overflow; -inf if all are -inf; NaN if any is NaN."""
    top = values.max()
    if not np.isfinite(top):
        return float(top)
    return float(top + np.log(np.exp(values - top).sum()))


def effective_size(weights: np.ndarray) -> float:
    """Effective number of particles, 1 / sum(w^2), of weights (N,) with sum 1; between 1 and N."""
    return kernels.effective_size(weights)


def systematic(weights: np.ndarray, n: int, rng: np.random.Generator) -> np.ndarray:
    """Low-variance resampling: n ancestors (n,) int64, ascending, from weights (N,) >= 0 with a positive sum.

    A particle of normalised weight w is drawn floor(n w) or ceil(n w) times, one of weight 0 never
    (Thrun, Burgard and Fox 2005, table 4.4: the paper's reference 67).
    """
    return kernels.systematic(weights, n, rng.random())


def sample_size(bins: int, error: float, quantile: float) -> int:
    """Particles so that their distribution over `bins` occupied bins is within `error` of the true one.

    `error` bounds the Kullback-Leibler divergence; `quantile` is the standard normal's upper quantile of the
    wanted probability, not the probability: 0.84 -> 0.99, 0.95 -> 1.64, 0.99 -> 2.33, 0.9987 -> 3.
    (Wilson-Hilferty approximation of the chi-square quantile; Fox 2001, equation 7.) One bin needs one.
    """
    if bins <= 1:
        return 1
    k = bins - 1
    a = 2.0 / (9.0 * k)
    return math.ceil(k / (2.0 * error) * (1.0 - a + math.sqrt(a) * quantile) ** 3)


def adapted_count(occupied: int, config: FilterConfig) -> int:
    """Number of particles for a distribution of which a sample fell into `occupied` cells."""
    wanted = sample_size(occupied, config.pf_err, config.pf_z)
    return min(max(wanted, config.min_particles), config.max_particles)


class Resampler:
    """Systematic resampling at every touch, to as many particles as KLD sampling asks for."""

    def __init__(self, regions: Regions, config: FilterConfig, rng: np.random.Generator):
        self._regions, self._config, self._rng = regions, config, rng

    def __call__(self, belief: Belief) -> None:
        """Draw the particles anew by their weights."""
        particles, n = belief.particles, len(belief.particles)
        ancestors = systematic(belief.weights, n, self._rng)
        wanted = self._wanted(particles.entries[ancestors])
        if wanted != n:
            ancestors = systematic(belief.weights, wanted, self._rng)
        belief.hold(particles.select(ancestors))

    def _wanted(self, entries: np.ndarray) -> int:
        """Number of particles that a distribution over the codebook like `entries` (n,) needs."""
        if not self._config.kld_sampling:
            return self._config.max_particles
        occupied = kernels.occupied_regions(self._regions.of_entry, entries, len(self._regions))
        return adapted_count(occupied, self._config)
