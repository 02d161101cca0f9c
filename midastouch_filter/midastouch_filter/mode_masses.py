"""How much of the belief each mode holds, set from outside the particles' own weights."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from . import resampling
from .particles import Particles

_FEWEST = 100  # particles of a new mode
_WORTH_PARTICLES = 0.005  # share of the belief below which a place gets none
_LEAST = 1e-9  # share that a refuted mode keeps, so that its weight stays finite


def pool_marginal_likelihoods(log_weights: np.ndarray, log_ratio: np.ndarray, parts: Sequence[np.ndarray]) -> None:
    """Change `log_ratio` (N,) so that all `parts` (index arrays) of the particles have the same marginal likelihood.

    It is that of all of them together; within each part the ratios between its particles stay.
    """
    parts = [part for part in parts if len(part)]
    if len(parts) < 2:
        return
    before = np.array([resampling.log_sum_exp(log_weights[part]) for part in parts])
    after = np.array([resampling.log_sum_exp(log_weights[part] + log_ratio[part]) for part in parts])
    if not (np.isfinite(before) & np.isfinite(after)).all():
        return
    together = np.logaddexp.reduce(after) - np.logaddexp.reduce(before)
    for part, gain in zip(parts, after - before, strict=True):
        log_ratio[part] += together - gain


def impose_log_odds(
    particles: Particles,
    members: np.ndarray,
    owners: Sequence[int | None],
    log_odds: np.ndarray,
    draw: Callable[[int, int], Particles],
    rest: float = 1.0,
) -> tuple[Particles, int]:
    """Particles whose modes hold the belief in the ratio of `log_odds` (P,) of P places, and how many of them are new.

    members (N,): mode of each particle, -1 for none; owners: for each place the mode that lies there, None if none
    does: then `draw(place, count)` makes its particles. Particles outside all owners keep their weights, but `rest` of
    the belief at most.
    """
    weights = particles.weights
    asked = np.isin(members, [k for k in owners if k is not None])
    odds = np.exp(log_odds - np.max(log_odds))
    log_weights = particles.log_weights.copy()
    outside = float(weights[~asked].sum())
    if outside > rest:
        log_weights[~asked] += np.log(rest / outside)
    share = (1.0 - min(outside, rest)) * odds / odds.sum()
    new: list[Particles] = []
    for place, (k, wanted) in enumerate(zip(owners, share, strict=True)):
        if k is not None:
            mine = members == k
            log_weights[mine] += np.log(max(wanted, _LEAST)) - resampling.log_sum_exp(particles.log_weights[mine])
        elif wanted > _WORTH_PARTICLES:
            drawn = draw(place, max(_FEWEST, round(wanted * len(particles))))
            drawn.log_weights += np.log(wanted)
            new.append(drawn)
    kept = Particles(particles.positions, particles.quaternions, log_weights, particles.entries)
    joined = Particles.joined([kept, *new])
    joined.log_weights -= resampling.log_sum_exp(joined.log_weights)
    return joined, len(new)
