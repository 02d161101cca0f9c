"""The fine stage of a step: when modes are refined by penetration maps, and how much mass each mode then holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..core import resampling
from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.estimate import Mode
from ..core.fingers import Finger
from ..core.gates import Gates, Stopwatch
from ..core.keyframes import KeyframeWindow
from ..core.motion_model import Odometry
from ..core.particles import Particles
from ..core.pose_hypothesis import Prior
from ..core.touch import Measurement
from .refinement import Refinement

_FEWEST_PARTICLES = 100  # particles of a new mode
_LEAST_FRACTION = 0.005  # fraction of the belief below which a hypothesis gets none
_LARGEST_NEW_FRACTION = 0.5  # of the number of particles, at one hypothesis
_REFUTED_FRACTION = 1e-9  # fraction that a refuted mode keeps, so that its weight stays finite


class Published(NamedTuple):
    """modes, heaviest first; listed: probability that the truth is among them, as far as that is known; covariance
    (6, 6), as of `Estimate`."""

    modes: list[Mode]
    listed: float
    covariance: np.ndarray


class CoarseOnly:
    """A step without a fine stage: the belief is that of the codes alone; `FineStage` replaces what maps change.

    Attributes: doubt: why nobody may rely on the dominant mode, in words, as far as that is asked for, empty if one
    may; unknown: probability that the last touches are of another object, as far as that is.
    """

    doubt = ""
    unknown = 0.0

    def restart(self, prior: Prior | None) -> None:
        """Begin anew with particles that were just drawn; `prior` is what is known of the present pose, if anything."""

    def score_anew(self, log_ratio_of: Callable[[Measurement], np.ndarray], n_poses: int) -> None:
        """Score kept touches again, once the look-up has other entries; arguments as of `Reevaluation.score_anew`."""

    def recall(self, measured: KeyframeWindow, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        """Take touches measured before a restart; arguments as of `Reevaluation.recall`."""

    def moved(self, motion: Odometry | None, path: float, in_contact: bool) -> None:
        """The first finger moved, None at rest; `path` [m] of the others."""

    def pool(self, belief: Belief, name: str, log_ratio: np.ndarray) -> None:
        """Change a finger's log-likelihood ratios (N,) before they are used."""

    def __call__(self, belief: Belief, measured: list[Finger], tempering: float) -> bool:
        """Change the belief by what was measured; whether maps explain the dominant mode."""
        return False

    def deferred_update(
        self, belief: Belief, measured: list[Finger], elapsed: float | None, in_time: Callable[[], bool]
    ) -> None:
        """Correct the belief by the last touches, including the present ones, whose estimate is already given.

        elapsed: seconds since the frame before, None if unknown; in_time: whether there is time left.
        """

    def published(self, belief: Belief) -> Published:
        """What is answered."""
        return Published(belief.answers, 1.0, belief.covariance)

    @property
    def measured_gels(self) -> np.ndarray:
        """(F, 4, 4) of the gels of the last touches that are kept, in the frame of the present first one."""
        return np.empty((0, 4, 4))

    def sharpened(self, belief: Belief) -> Particles:
        """The particles at this very frame, as `Belief.answers`."""
        return belief.particles


class FineStage(CoarseOnly):
    """Aligns narrow modes to the measured maps.

    Args: refinement; config; gates; watch.
    Attribute: region, how far from the published pose the truth may be.
    """

    def __init__(self, refinement: Refinement, config: FilterConfig, gates: Gates, watch: Stopwatch):
        self._refinement, self.region = refinement, refinement.region
        self._config, self._gates, self._watch = config, gates, watch

    def restart(self, prior: Prior | None) -> None:
        self.region.restart()

    def pool(self, belief: Belief, name: str, log_ratio: np.ndarray) -> None:
        """Give a code the same weight for all modes that the last maps of the finger fitted.

        Between them the maps decide, which tell more: a code's small errors are the same all along an edge, and would
        in time kill one of two hypotheses that are alike.
        """
        if name in belief.aligned_to and len(belief.aligned) > 1:
            members = belief.members
            parts = [np.flatnonzero(members == k) for k in belief.aligned]
            pool_marginal_likelihoods(belief.particles.log_weights, log_ratio, parts)

    def __call__(self, belief: Belief, measured: list[Finger], tempering: float) -> bool:
        mapped = mapped_of(measured)
        if not mapped:
            return False
        with self._watch.stage("refinement"):
            belief.explained = self._refine(belief, mapped, tempering)
        return bool(belief.explained)

    def _refine(self, belief: Belief, mapped: list[Finger], tempering: float) -> frozenset[str]:
        """Let the maps place the particles of narrow modes; names of the fingers whose maps the heaviest one fits."""
        modes = belief.modes
        mapped = [finger for finger in mapped if self._refinement.reaches(modes, finger.touch.T_gel_finger)]
        aligned = {}
        if mapped:
            touches = [finger.touch for finger in mapped]
            aligned = self._refinement.apply(belief.particles, belief.members, modes, touches)
        if self._gates.skips("wide_modes", not aligned):
            return frozenset()
        fitting = {k: each for k, each in aligned.items() if each.fit > self._config.penetration_fit}
        gains = self._refinement.gains(modes, aligned, tempering)
        names = frozenset(finger.name for finger in mapped)
        belief.align(fitting, gains, names, self.region.widening)
        return names if 0 in belief.aligned else frozenset()

    def sharpened(self, belief: Belief) -> Particles:
        if not belief.aligned:
            return belief.particles
        return self._refinement.sharpened(belief.particles, belief.members, belief.modes, belief.aligned)


def mapped_of(measured: list[Finger]) -> list[Finger]:
    """The fingers that measured a penetration map."""
    return [finger for finger in measured if finger.touch.penetration is not None]


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


def impose_fractions(
    particles: Particles,
    members: np.ndarray,
    owners: Sequence[int | None],
    fractions: np.ndarray,
    elsewhere: float,
    draw: Callable[[int | None, int], Particles],
    exact: bool = True,
) -> tuple[Particles, int]:
    """Particles that hold the fractions (P,) of the belief at P hypotheses and the rest, `elsewhere`, outside of them.

    members (N,): mode of each particle, -1 for none; owners: for each hypothesis the mode that lies there, None if none
    does: then `draw(hypothesis, count)` makes its particles, and `draw(None, count)` what is missing outside. Unless
    `exact`, particles outside hold what they do, if it is more than `elsewhere`. Returns the number of new groups too.
    """
    group, owned = members + 1, [k + 1 for k in owners if k is not None]  # group 0: of no mode
    held = np.bincount(group, particles.weights, minlength=max(owned, default=0) + 1)
    outside = np.delete(np.arange(len(held)), owned)
    now = float(held[outside].sum())
    rest = elsewhere if exact else max(elsewhere, now)
    gain = np.zeros(len(held))
    new: list[Particles] = []

    def born(hypothesis: int | None, fraction: float) -> None:
        if fraction > _LEAST_FRACTION:
            drawn = draw(
                hypothesis, max(_FEWEST_PARTICLES, round(min(fraction, _LARGEST_NEW_FRACTION) * len(particles)))
            )
            drawn.log_weights += np.log(fraction)
            new.append(drawn)

    if now > rest:
        gain[outside] = np.log(max(rest, _REFUTED_FRACTION) / now)
    else:
        born(None, rest - now)
    for hypothesis, (k, wanted) in enumerate(
        zip(owners, fractions * (1.0 - rest) / max(fractions.sum(), _REFUTED_FRACTION), strict=True)
    ):
        if k is None:
            born(hypothesis, wanted)
        else:
            gain[k + 1] = np.log(max(wanted, _REFUTED_FRACTION)) - np.log(max(held[k + 1], np.finfo(float).tiny))
    log_weights = particles.log_weights + gain[group]
    kept = Particles(particles.positions, particles.quaternions, log_weights, particles.entries)
    joined = Particles.joined([kept, *new])
    joined.log_weights -= resampling.log_sum_exp(joined.log_weights)
    return joined, len(new)
