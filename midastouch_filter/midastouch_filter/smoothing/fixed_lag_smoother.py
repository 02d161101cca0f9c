"""Fixed-lag smoothing: what the last touches together say of the modes that codes and maps have found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from midastouch_common import se3

from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.fingers import Finger
from ..core.gates import Gates, Stopwatch
from ..core.initialisation import ParticleSource
from ..core.keyframes import KeyframeWindow
from ..core.motion_model import Odometry
from ..core.noise_model import NoiseModel
from ..core.particles import Particles
from ..core.pose_hypothesis import Prior, another
from ..core.resampling import Resampler
from ..core.touch import Measurement
from ..refinement.fine_stage import FineStage, Published, impose_fractions, mapped_of
from ..refinement.refinement import Refinement, is_narrow
from .pace import InTime
from .published_modes import owners_of, published_modes
from .reevaluation import Comparison, Reevaluation

_NOT_COMPARED = "it was not compared with other hypotheses yet"
_NEGLIGIBLE_CHANGE = 0.02  # change of a hypothesis' fraction of the belief


class FixedLagSmoother(FineStage):
    """A fine stage that compares the modes with other hypotheses, by the last touches.

    Args: refinement; reevaluation; config; noise; source of particles for new modes; resample; gates; watch.
    Attribute: comparison, the last one, as it was then; None before the first.
    """

    def __init__(
        self,
        refinement: Refinement,
        reevaluation: Reevaluation,
        config: FilterConfig,
        noise: NoiseModel,
        source: ParticleSource,
        resample: Resampler,
        gates: Gates,
        watch: Stopwatch,
    ):
        super().__init__(refinement, config, gates, watch)
        self._reevaluation, self._noise = reevaluation, noise
        self._source, self._resample = source, resample

    def restart(self, prior: Prior | None) -> None:
        super().restart(prior)
        self.doubt, self.unknown = _NOT_COMPARED, 0.0
        self._in_contact = False
        self.comparison: Comparison | None = None
        self._compared_at = np.eye(4)
        self._dominant: tuple[np.ndarray, np.ndarray] | None = None  # its pose, and the motion until then
        self._reevaluation.restart(prior)

    def score_anew(self, log_ratio_of: Callable[[Measurement], np.ndarray], n_poses: int) -> None:
        self._reevaluation.score_anew(log_ratio_of, n_poses)

    def recall(self, measured: KeyframeWindow, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        self._reevaluation.recall(measured, log_ratio_of)

    def moved(self, motion: Odometry | None, path: float, in_contact: bool) -> None:
        if motion is None:
            self._reevaluation.moved(np.eye(4), path, in_contact)
        else:
            self._reevaluation.moved(motion.transform, motion.path, in_contact)
        if self._reevaluation.lifted:
            self.doubt = _NOT_COMPARED
        self._in_contact = in_contact

    def __call__(self, belief: Belief, measured: list[Finger], tempering: float) -> bool:
        self._forget_corrections(belief.modes[0].pose)
        explained = super().__call__(belief, measured, tempering)
        if mapped_of(measured):
            self.doubt = self._doubt_of(belief) if explained else "the last touch does not fit it"
        return explained

    def _forget_corrections(self, pose: np.ndarray) -> None:
        """Unless the dominant mode, now at `pose` (4, 4), is where it was, what maps corrected says nothing of it."""
        motion = self._reevaluation.motion
        before, at = self._dominant or (pose, motion)
        if another()((before @ (se3.inverse(at) @ motion))[None], pose)[0]:
            self.region.restart()
        self._dominant = pose, motion

    def deferred_update(self, belief: Belief, measured: list[Finger], elapsed: float | None, in_time: InTime) -> None:
        if mapped_of(measured):
            with self._watch.stage("hindsight"):
                self._keep(measured)
                contradicted = is_narrow(belief.modes[0], self._config) and 0 not in belief.aligned
                if not self._gates.skips("unrivalled", self._reevaluation.rests(contradicted)):
                    self._compare(belief, elapsed, in_time)
        elif self._in_contact and not measured and not self._reevaluation.rests(contradicted=False):
            with self._watch.stage("hindsight"):  # no touch will come that asks what the comparison leaves in doubt
                if self._compare(belief, elapsed, in_time):
                    self.doubt = self._doubt_of(belief)

    def _keep(self, measured: list[Finger]) -> None:
        """Keep the touch, if it is far enough from the last one that is kept."""
        if self._reevaluation.due:
            touching = [finger for finger in measured if finger.touch.in_contact]
            self._reevaluation.keep(
                [finger.touch for finger in touching], [finger.log_ratio_of_codebook() for finger in touching]
            )

    def _compare(self, belief: Belief, elapsed: float | None, in_time: InTime) -> bool:
        """Go on asking whether other hypotheses explain the last touches as well; whether that was answered."""
        narrow = [mode for mode in belief.modes if is_narrow(mode, self._config)]
        poses = [mode.pose for mode in narrow[: self._config.refined_modes]]
        comparison = self._reevaluation.compare(poses, elapsed, in_time)
        if comparison is None:
            return False
        self._believe(belief, comparison)
        self.comparison, self._compared_at = comparison, self._reevaluation.motion
        self.unknown = comparison.unknown
        return True

    def _doubt_of(self, belief: Belief) -> str:
        """What the last comparison leaves in doubt of the dominant mode, in words; empty if nothing."""
        known, reevaluation = self.comparison, self._reevaluation
        if known is None or reevaluation.lifted:
            return _NOT_COMPARED
        if not known.exhaustive:
            return "not all other hypotheses were compared with it"
        pose = belief.modes[0].pose @ (se3.inverse(reevaluation.motion) @ self._compared_at)
        probability = known.probability_at(pose, self._config.converged_error)
        if probability < self._config.converged_probability:
            return f"by the last touches it is right with {probability:.1%} only"
        return ""

    def _believe(self, belief: Belief, comparison: Comparison) -> None:
        """Give the modes the probability of their hypotheses, and competitors that have no particles some of their
        own."""
        owners = list(owners_of(comparison.hypotheses, belief.modes, comparison, self._config))
        fractions = np.array([hypothesis.probability for hypothesis in comparison.hypotheses])
        held = np.array([0.0 if k is None else belief.modes[k].weight for k in owners])
        if np.abs(held - fractions).max() < _NEGLIGIBLE_CHANGE:
            return
        particles, new = impose_fractions(
            belief.particles,
            belief.members,
            owners,
            fractions,
            comparison.elsewhere,
            lambda hypothesis, count: self._born(comparison, hypothesis, count),
            exact=comparison.exhaustive,
        )
        self._gates.count("rivals", new)
        belief.hold(particles)
        self._resample(belief)
        belief.cluster()

    def _born(self, comparison: Comparison, hypothesis: int | None, count: int) -> Particles:
        """Particles at one of the hypotheses, or (None) wherever codes put them."""
        if hypothesis is None:
            return self._source.among(comparison.cloud, comparison.cloud_scores, self._noise.between_entries, count)
        return self._source.at(comparison.hypotheses[hypothesis], count)

    def published(self, belief: Belief) -> Published:
        known, reevaluation = self.comparison, self._reevaluation
        if known is None:
            return Published(belief.answers, 0.0, belief.covariance)
        onward = se3.inverse(self._compared_at) @ reevaluation.motion
        still = 1.0 - self._noise.change_lifted if reevaluation.lifted else 1.0
        return published_modes(known, onward, still, belief, self._config)

    @property
    def measured_gels(self) -> np.ndarray:
        return self._reevaluation.measured_gels
