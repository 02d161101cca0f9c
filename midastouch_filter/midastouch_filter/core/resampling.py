"""Weights in the log domain, effective sample size and systematic resampling (paper section 4.3)."""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels


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
