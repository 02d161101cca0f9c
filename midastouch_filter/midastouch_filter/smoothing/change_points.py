"""Which place explains the touches at present, if the object may have been moved between any two of them?

A hidden Markov model over places: the forward recursion of Bayesian change-point detection (Adams and MacKay 2007)
with the places on the object as states. Touch by touch a place keeps what it held, unless the motion was broken before
the touch: then it is anywhere. One state more stands for all places that nobody named.
"""

from __future__ import annotations

import numpy as np


def place_posterior(
    evidence: np.ndarray, log_prior: np.ndarray, log_arrival: np.ndarray, change: np.ndarray
) -> tuple[np.ndarray, float]:
    """Probabilities (P,) of P places at the newest of K touches, and that of being elsewhere.

    evidence (P, K) nats of each touch, oldest first, for each place against a place not named; log_prior, log_arrival
    (P + 1,) of each place at the first touch and after a broken motion, that of being elsewhere last; change (K,):
    probability that the motion was broken before a touch.
    """
    belief = log_prior
    gains = np.vstack([evidence, np.zeros((1, evidence.shape[1]))])
    for k, broken in enumerate(change):
        belief = belief - np.logaddexp.reduce(belief)
        if k:
            belief = np.logaddexp(belief + np.log1p(-broken), np.log(broken) + log_arrival)
        belief = belief + gains[:, k]
    share = np.exp(belief - np.logaddexp.reduce(belief))
    return share[:-1], float(share[-1])
