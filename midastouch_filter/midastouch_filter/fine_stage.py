"""Coarse to fine: what penetration maps and the last touches say of the modes that codes have found."""

from __future__ import annotations

import math

import numpy as np

from .belief import Belief
from .config import FilterConfig
from .fingers import Finger
from .gates import Gates
from .initialisation import ParticleSource
from .mode_masses import impose_log_odds, pool_marginal_likelihoods
from .motion_model import Odometry
from .noise_model import NoiseModel
from .particles import Particles
from .places import Prior, pose_distance
from .reevaluation import Comparison, Reevaluation
from .refinement import Refinement
from .stopwatch import Stopwatch


class CoarseOnly:
    """No fine stage: the belief is that of the codes alone.

    Attributes: checked: whether other places were compared with the dominant mode, as far as that is asked for.
    """

    checked = True

    def restart(self, prior: Prior | None) -> None:
        """The particles were drawn anew; `prior` is what is known of the present pose."""

    def moved(self, motion: Odometry | None, path: float, in_contact: bool) -> None:
        """The first finger moved, None at rest; `path` [m] of the others."""

    def contradicted(self) -> None:
        """The last touches fit the belief badly."""

    def pool(self, belief: Belief, name: str, log_ratio: np.ndarray) -> None:
        """Change a finger's log-likelihood ratios (N,) before they are used."""

    def __call__(self, belief: Belief, felt: list[Finger], tempering: float) -> bool:
        """Change the belief by what was felt; whether maps explain the dominant mode."""
        return False

    def sharpened(self, belief: Belief) -> Particles:
        """The particles at this very frame, as `Belief.answers`."""
        return belief.particles


class FineStage(CoarseOnly):
    """Aligns narrow modes to the felt maps, and compares them with other places.

    Args: refinement; reevaluation, None for none; config; noise; source of particles for new modes; gates; watch.
    """

    def __init__(
        self,
        refinement: Refinement,
        reevaluation: Reevaluation | None,
        config: FilterConfig,
        noise: NoiseModel,
        source: ParticleSource,
        gates: Gates,
        watch: Stopwatch,
    ):
        self._refinement, self._reevaluation, self._source = refinement, reevaluation, source
        self._config, self._noise, self._gates, self._watch = config, noise, gates, watch

    def restart(self, prior: Prior | None) -> None:
        self.checked = self._reevaluation is None
        if self._reevaluation:
            self._reevaluation.restart(prior)

    def moved(self, motion: Odometry | None, path: float, in_contact: bool) -> None:
        if self._reevaluation and motion is not None:
            self._reevaluation.moved(motion.transform, motion.path, in_contact)
        elif self._reevaluation:
            self._reevaluation.moved(np.eye(4), path, in_contact)

    def contradicted(self) -> None:
        if self._reevaluation:
            self._reevaluation.contradicted()

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
        mapped = [finger for finger in felt if finger.touch.penetration is not None]
        if not mapped:
            return False
        with self._watch.stage("refinement"):
            explained = self._refine(belief, mapped, tempering)
        if self._reevaluation:
            with self._watch.stage("hindsight"):
                self._reevaluate(belief, self._reevaluation, felt)
        return explained

    def _refine(self, belief: Belief, mapped: list[Finger], tempering: float) -> bool:
        """Let the maps place the particles of narrow modes."""
        modes = belief.modes
        mapped = [finger for finger in mapped if self._refinement.reaches(modes, finger.touch.T_gel_finger)]
        aligned = {}
        if mapped:
            touches = [finger.touch for finger in mapped]
            aligned = self._refinement.apply(belief.particles, belief.members, modes, touches, tempering)
        if self._gates.skips("wide_modes", not aligned):
            return False
        fitting = {k: each for k, each in aligned.items() if each.fit > self._config.relief_fit}
        belief.align(fitting, frozenset(finger.name for finger in mapped))
        return 0 in belief.aligned

    def _reevaluate(self, belief: Belief, reevaluation: Reevaluation, felt: list[Finger]) -> None:
        """Keep the touch, and go on asking whether other places explain the last ones as well."""
        if reevaluation.due:
            touching = [finger for finger in felt if finger.touch.in_contact]
            reevaluation.keep(
                [finger.touch for finger in touching], [finger.log_ratio_of_codebook() for finger in touching]
            )
        narrow = [mode for mode in belief.modes if self._refinement.is_narrow(mode)]
        if not narrow or narrow[0] is not belief.modes[0]:
            return
        if self._gates.skips("unrivalled", len(narrow) == 1 and reevaluation.rests):
            return
        comparison = reevaluation.compare([mode.pose for mode in narrow[: self._config.refined_modes]])
        if comparison is not None:
            self._believe(belief, comparison)

    def _believe(self, belief: Belief, comparison: Comparison) -> None:
        """Give the modes the odds of their places, and rivals that have no particles some of their own."""
        places = comparison.places
        self.checked = True
        owners: list[int | None] = []
        for place in places:
            k = self._mode_at(belief, place.pose)
            owners.append(None if k in owners else k)
        particles, new = impose_log_odds(
            belief.particles,
            belief.members,
            owners,
            np.array([place.log_odds for place in places]),
            lambda place, count: self._source.at(places[place], count),
            rest=math.exp(-self._noise.code_margin) if comparison.exhaustive else 1.0,
        )
        self._gates.count("rivals", new)
        belief.hold(particles)
        belief.cluster()

    def _mode_at(self, belief: Belief, pose: np.ndarray) -> int | None:
        """The mode nearest to a pose (4, 4), None if it is another place."""
        distance = [pose_distance(mode.pose, pose) for mode in belief.modes]
        return int(np.argmin(distance)) if min(distance) < self._config.mode_radius else None

    def sharpened(self, belief: Belief) -> Particles:
        if not belief.aligned:
            return belief.particles
        return self._refinement.sharpened(belief.particles, belief.members, belief.modes, belief.aligned)
