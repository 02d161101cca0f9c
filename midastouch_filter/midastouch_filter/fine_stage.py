"""Coarse to fine: what penetration maps and the last touches say of the modes that codes have found."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from midastouch_perception import se3

from .belief import Belief
from .config import FilterConfig
from .estimate import Mode
from .fingers import Finger
from .gates import Gates
from .initialisation import ParticleSource
from .keyframes import KeyframeWindow
from .mode_masses import impose_shares, pool_marginal_likelihoods
from .motion_model import Odometry
from .noise_model import NoiseModel
from .particles import Particles
from .places import Place, Prior, pose_distance
from .reevaluation import Comparison, Reevaluation
from .refinement import Refinement, is_narrow
from .resampler import Resampler
from .stopwatch import Stopwatch
from .touch import Measurement

_NEGLIGIBLE = 0.02  # change of a place's share of the belief


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
    """Aligns narrow modes to the felt maps, and compares them with other places.

    Args: refinement; reevaluation, None for none; config; noise; source of particles for new modes; resample; gates;
    watch.
    Attribute: region, how far from the published pose the truth may be.
    """

    def __init__(
        self,
        refinement: Refinement,
        reevaluation: Reevaluation | None,
        config: FilterConfig,
        noise: NoiseModel,
        source: ParticleSource,
        resample: Resampler,
        gates: Gates,
        watch: Stopwatch,
    ):
        self._refinement, self._reevaluation, self.region = refinement, reevaluation, refinement.region
        self._source, self._resample = source, resample
        self._config, self._noise, self._gates, self._watch = config, noise, gates, watch

    def restart(self, prior: Prior | None) -> None:
        self.checked = self._reevaluation is None
        self._known: Comparison | None = None
        self.region.restart()
        if self._reevaluation:
            self._known_at = np.eye(4)
            self._reevaluation.restart(prior)

    def score_anew(self, log_ratio_of: Callable[[Measurement], np.ndarray], places: int) -> None:
        if self._reevaluation:
            self._reevaluation.score_anew(log_ratio_of, places)

    def recall(self, felt: KeyframeWindow, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        if self._reevaluation:
            self._reevaluation.recall(felt, log_ratio_of)

    def moved(self, motion: Odometry | None, path: float, in_contact: bool) -> None:
        if self._reevaluation and motion is not None:
            self._reevaluation.moved(motion.transform, motion.path, in_contact)
        elif self._reevaluation:
            self._reevaluation.moved(np.eye(4), path, in_contact)
        self.checked = self.checked and not (self._reevaluation and self._reevaluation.lifted)

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
        mapped = _mapped(felt)
        if not mapped:
            return False
        with self._watch.stage("refinement"):
            explained = self._refine(belief, mapped, tempering)
        if self._reevaluation:
            self.checked = explained and self._is_trusted(belief, self._reevaluation)
        return explained

    def reflect(self, belief: Belief, felt: list[Finger]) -> None:
        if self._reevaluation and _mapped(felt):
            with self._watch.stage("hindsight"):
                self._reevaluate(belief, self._reevaluation, felt)

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
        fitting = {k: each for k, each in aligned.items() if each.fit > self._config.relief_fit}
        gains = self._refinement.gains(modes, aligned, tempering)
        names = frozenset(finger.name for finger in mapped)
        belief.align(fitting, gains, names, self.region.widening)
        return 0 in belief.aligned

    def _reevaluate(self, belief: Belief, reevaluation: Reevaluation, felt: list[Finger]) -> None:
        """Keep the touch, and go on asking whether other places explain the last ones as well."""
        if reevaluation.due:
            touching = [finger for finger in felt if finger.touch.in_contact]
            reevaluation.keep(
                [finger.touch for finger in touching], [finger.log_ratio_of_codebook() for finger in touching]
            )
        narrow = [mode for mode in belief.modes if is_narrow(mode, self._config)]
        contradicted = bool(narrow) and narrow[0] is belief.modes[0] and 0 not in belief.aligned
        if not self._gates.skips("unrivalled", reevaluation.rests(contradicted)):
            comparison = reevaluation.compare([mode.pose for mode in narrow[: self._config.refined_modes]])
            if comparison is not None:
                self._believe(belief, comparison)
                self._known, self._known_at = comparison, reevaluation.motion

    def _is_trusted(self, belief: Belief, reevaluation: Reevaluation) -> bool:
        """Whether the last comparison found the dominant mode probable enough, and left no place out."""
        if self._known is None or not self._known.exhaustive or reevaluation.lifted:
            return False
        place = belief.modes[0].pose @ (se3.inverse(reevaluation.motion) @ self._known_at)
        return self._known.probability_at(place) >= self._config.converged_probability

    def _believe(self, belief: Belief, comparison: Comparison) -> None:
        """Give the modes the probability of their places, and rivals that have no particles some of their own."""
        owners: list[int | None] = []
        for k in self._modes_at(belief.modes, comparison.places):
            owners.append(None if k in owners else k)
        shares = np.array([place.probability for place in comparison.places])
        held = np.array([0.0 if k is None else belief.modes[k].weight for k in owners])
        if np.abs(held - shares).max() < _NEGLIGIBLE:
            return
        particles, new = impose_shares(
            belief.particles,
            belief.members,
            owners,
            shares,
            comparison.elsewhere,
            lambda place, count: self._born(comparison, place, count),
            exact=comparison.exhaustive,
        )
        self._gates.count("rivals", new)
        belief.hold(particles)
        self._resample(belief, needed=True)
        belief.cluster()

    def _born(self, comparison: Comparison, place: int | None, count: int) -> Particles:
        """Particles at one of the places, or (None) wherever codes put them."""
        if place is None:
            return self._source.among(comparison.cloud, comparison.cloud_scores, self._noise.between_entries, count)
        return self._source.at(comparison.places[place], count)

    def _modes_at(self, modes: list[Mode], places: list[Place]) -> Iterator[int | None]:
        """The narrow mode nearest to each place, None if it is another place."""
        poses = np.stack([mode.pose for mode in modes])
        for place in places:
            distance = pose_distance(poses, place.pose)
            k = int(np.argmin(distance))
            yield k if distance[k] < self._config.mode_radius and is_narrow(modes[k], self._config) else None

    @property
    def felt(self) -> np.ndarray:
        return self._reevaluation.felt if self._reevaluation else super().felt

    def sharpened(self, belief: Belief) -> Particles:
        if not belief.aligned:
            return belief.particles
        return self._refinement.sharpened(belief.particles, belief.members, belief.modes, belief.aligned)


def _mapped(felt: list[Finger]) -> list[Finger]:
    """The fingers that felt a penetration map."""
    return [finger for finger in felt if finger.touch.penetration is not None]
