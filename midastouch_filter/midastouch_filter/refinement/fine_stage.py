"""Coarse to fine: what penetration maps say of the modes that codes have found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.fingers import Finger
from ..core.gates import Gates
from ..core.keyframes import KeyframeWindow
from ..core.motion_model import Odometry
from ..core.particles import Particles
from ..core.places import Prior
from ..core.stopwatch import Stopwatch
from ..core.touch import Measurement
from .mode_masses import pool_marginal_likelihoods
from .refinement import Refinement


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
