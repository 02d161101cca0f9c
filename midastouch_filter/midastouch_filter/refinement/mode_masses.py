"""How much of the belief each mode holds, set from outside the particles' own weights."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..core import resampling
from ..core.particles import Particles

_FEWEST = 100  # particles of a new mode
_WORTH_PARTICLES = 0.005  # share of the belief below which a place gets none
_MOST_BORN = 0.5  # of the number of particles, at one place
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


def impose_shares(
    particles: Particles,
    members: np.ndarray,
    owners: Sequence[int | None],
    shares: np.ndarray,
    elsewhere: float,
    draw: Callable[[int | None, int], Particles],
    exact: bool = True,
) -> tuple[Particles, int]:
    """Particles that hold the shares (P,) of the belief at P places and the rest, `elsewhere`, outside of them.

    members (N,): mode of each particle, -1 for none; owners: for each place the mode that lies there, None if none
    does: then `draw(place, count)` makes its particles, and `draw(None, count)` what is missing outside. Unless
    `exact`, particles outside hold what they do, if it is more than `elsewhere`. Returns the number of new groups too.
    """
    group, owned = members + 1, [k + 1 for k in owners if k is not None]  # group 0: of no mode
    held = np.bincount(group, particles.weights, minlength=max(owned, default=0) + 1)
    outside = np.delete(np.arange(len(held)), owned)
    now = float(held[outside].sum())
    rest = elsewhere if exact else max(elsewhere, now)
    gain = np.zeros(len(held))
    new: list[Particles] = []

    def born(place: int | None, share: float) -> None:
        if share > _WORTH_PARTICLES:
            drawn = draw(place, max(_FEWEST, round(min(share, _MOST_BORN) * len(particles))))
            drawn.log_weights += np.log(share)
            new.append(drawn)

    if now > rest:
        gain[outside] = np.log(max(rest, _LEAST) / now)
    else:
        born(None, rest - now)
    for place, (k, wanted) in enumerate(zip(owners, shares * (1.0 - rest) / max(shares.sum(), _LEAST), strict=True)):
        if k is None:
            born(place, wanted)
        else:
            gain[k + 1] = np.log(max(wanted, _LEAST)) - np.log(max(held[k + 1], np.finfo(float).tiny))
    log_weights = particles.log_weights + gain[group]
    kept = Particles(particles.positions, particles.quaternions, log_weights, particles.entries)
    joined = Particles.joined([kept, *new])
    joined.log_weights -= resampling.log_sum_exp(joined.log_weights)
    return joined, len(new)
