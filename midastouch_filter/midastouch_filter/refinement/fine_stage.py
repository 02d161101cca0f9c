"""Coarse to fine: what penetration maps say of the modes that codes have found, and how much mass each then holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..core import resampling
from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.fingers import Finger
from ..core.gates import Gates, Stopwatch
from ..core.keyframes import KeyframeWindow
from ..core.motion_model import Odometry
from ..core.particles import Particles
from ..core.places import Prior
from ..core.touch import Measurement
from .refinement import Refinement

_FEWEST = 100  # particles of a new mode
_WORTH_PARTICLES = 0.005  # share of the belief below which a place gets none
_MOST_BORN = 0.5  # of the number of particles, at one place
_LEAST = 1e-9  # share that a refuted mode keeps, so that its weight stays finite


class CoarseOnly:
    """No fine stage: the belief is that of the codes alone.

    Attributes: checked: whether other places were compared with the dominant mode, as far as that is asked for.
    """

    checked = True

    def restart(self, prior: Prior | None) -> None:
        """The particles were drawn anew; `prior` is what is known of the present pose."""

    def score_anew(self, log_ratio_of: Callable[[Measurement], np.ndarray], places: int) -> None:
        """The look-up has other entries; arguments as `Reevaluation.score_anew`."""

    def recall(self, felt: KeyframeWindow, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        """After a restart: what was felt before it; arguments as of `Reevaluation.recall`."""

    def moved(self, motion: Odometry | None, path: float, in_contact: bool) -> None:
        """The first finger moved, None at rest; `path` [m] of the others."""

    def pool(self, belief: Belief, name: str, log_ratio: np.ndarray) -> None:
        """Change a finger's log-likelihood ratios (N,) before they are used."""

    def __call__(self, belief: Belief, felt: list[Finger], tempering: float) -> bool:
        """Change the belief by what was felt; whether maps explain the dominant mode."""
        return False

    def reflect(self, belief: Belief, felt: list[Finger]) -> None:
        """Change the belief by what the last touches say, these included; the answer to them is out."""

    @property
    def felt(self) -> np.ndarray:
        """(F, 4, 4) of the gels of the last touches that are kept, in the frame of the present first one."""
        return np.empty((0, 4, 4))

    def sharpened(self, belief: Belief) -> Particles:
        """The particles at this very frame, as `Belief.answers`."""
        return belief.particles


class FineStage(CoarseOnly):
    """Aligns narrow modes to the felt maps.

    Args: refinement; config; gates; watch.
    Attribute: region, how far from the published pose the truth may be.
    """

    def __init__(self, refinement: Refinement, config: FilterConfig, gates: Gates, watch: Stopwatch):
        self._refinement, self.region = refinement, refinement.region
        self._config, self._gates, self._watch = config, gates, watch

    def restart(self, prior: Prior | None) -> None:
        self.region.restart()

    def pool(self, belief: Belief, name: str, log_ratio: np.ndarray) -> None:
        """Let a code speak for all modes that the last maps of the finger fitted as for one.

        Between them the maps decide, which tell more: a code's small errors are the same all along an edge, and would
        in time kill one of two places that feel alike.
        """
        if name in belief.aligned_to and len(belief.aligned) > 1:
            members = belief.members
            parts = [np.flatnonzero(members == k) for k in belief.aligned]
            pool_marginal_likelihoods(belief.particles.log_weights, log_ratio, parts)

    def __call__(self, belief: Belief, felt: list[Finger], tempering: float) -> bool:
        mapped = mapped_of(felt)
        if not mapped:
            return False
        with self._watch.stage("refinement"):
            return self._refine(belief, mapped, tempering)

    def _refine(self, belief: Belief, mapped: list[Finger], tempering: float) -> bool:
        """Let the maps place the particles of narrow modes."""
        modes = belief.modes
        mapped = [finger for finger in mapped if self._refinement.reaches(modes, finger.touch.T_gel_finger)]
        aligned = {}
        if mapped:
            touches = [finger.touch for finger in mapped]
            aligned = self._refinement.apply(belief.particles, belief.members, modes, touches)
        if self._gates.skips("wide_modes", not aligned):
            return False
        fitting = {k: each for k, each in aligned.items() if each.fit > self._config.penetration_fit}
        gains = self._refinement.gains(modes, aligned, tempering)
        names = frozenset(finger.name for finger in mapped)
        belief.align(fitting, gains, names, self.region.widening)
        return 0 in belief.aligned

    def sharpened(self, belief: Belief) -> Particles:
        if not belief.aligned:
            return belief.particles
        return self._refinement.sharpened(belief.particles, belief.members, belief.modes, belief.aligned)


def mapped_of(felt: list[Finger]) -> list[Finger]:
    """The fingers that felt a penetration map."""
    return [finger for finger in felt if finger.touch.penetration is not None]


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
