"""How many particles the distribution needs (KLD sampling, Fox 2001)."""

from __future__ import annotations

import math

from .config import FilterConfig


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
    """Number of particles for a distribution of which a sample fell into so many cells."""
    wanted = sample_size(occupied, config.pf_err, config.pf_z)
    return min(max(wanted, config.min_particles), config.max_particles)
