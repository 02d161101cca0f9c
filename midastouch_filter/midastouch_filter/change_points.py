"""Which place explains the touches at present, if the object may have been moved between any two of them?

A hidden Markov model over places: the forward recursion of Bayesian change-point detection (Adams and MacKay 2007)
with the places on the object as states. Touch by touch a place keeps what it held, unless the motion was broken before
the touch: then any place is as likely as any other. One state more stands for all places that nobody named.
"""

from __future__ import annotations

import numpy as np


def place_posterior(
    evidence: np.ndarray, log_prior: np.ndarray, change: np.ndarray, places: float
) -> tuple[np.ndarray, float]:
    """Probabilities (P,) of P places at the newest of K touches, and that of being elsewhere.

    evidence (P, K) nats of each touch, oldest first, for each place against a place not named; log_prior (P,) of each
    at the first touch; change (K,): probability that the motion was broken before a touch; places: number of all that
    the object has, of which a broken motion may lead to any.
    """
    elsewhere = np.log(max(1.0 - np.exp(log_prior).sum(), 1.0 / places))
    belief = np.append(log_prior, elsewhere)
    arrivals = np.append(np.full(len(log_prior), -np.log(places)), 0.0)
    gains = np.vstack([evidence, np.zeros((1, evidence.shape[1]))])
    for k, broken in enumerate(change):
        belief = belief - np.logaddexp.reduce(belief)
        if k:
            belief = np.logaddexp(belief + np.log1p(-broken), np.log(broken) + arrivals)
        belief = belief + gains[:, k]
    share = np.exp(belief - np.logaddexp.reduce(belief))
    return share[:-1], float(share[-1])
