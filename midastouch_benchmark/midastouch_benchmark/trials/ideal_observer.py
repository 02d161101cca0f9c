"""The ideal observer: who compares every pose of the codebook with all that was measured. It shows what could be known.

It gets what the filter gets, and judges it by the filter's own measurement model (`NoiseModel`): maps by alignment
along the path, touch by touch, each weighed by how independent it is, codes by the entries around a pose. Where the
filter looks for a few candidates, keeps a window and has a budget, it leaves nothing out: at the first touch, and after
each lift, all entries of the codebook are hypotheses. Those that go hold a millionth of the probability together at
most, and hypotheses that meet become one, which has the prior probability of all of them. That is the forward recursion
of a hidden Markov model whose hypotheses are Gaussians; between two lifts the object is taken to rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.alignment import Aligned, align_in_turn, transform_covariance, without_jitter
from midastouch_filter.core.keyframes import Keyframe, KeyframeWindow, independence
from midastouch_filter.core.motion_model import Odometry
from midastouch_filter.core.noise_model import Effort, NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.pose_hypothesis import Prior
from midastouch_filter.core.touch import Measurement
from midastouch_filter.smoothing.competitor_search import CompetitorSearch
from midastouch_perception.symmetry.group import Symmetry

from .trial import TrialFrame, with_odometry
from .yardstick import Yardstick

EVIDENCE = ("maps", "codes", "both")
"""What poses are compared with."""
KNOWN = 0.99
"""Probability from which on the observer knows."""

_DROPPED = 1e-6  # of the probability, shared among all entries: hypotheses with less of it go
_SAME_T, _SAME_R = 2e-3, np.radians(2.0)  # m, rad: hypotheses that are nearer have met
_MORE = 0.01  # of a map, less than which an alignment has settled
_LEADING = 10  # hypotheses, around one of which the most probable place is


@dataclass(frozen=True)
class Hypotheses:
    """P poses (P, 4, 4) `T_obj_gel`, covariances (P, 6, 6) in their own frames, log_prior (P,), normalised, and
    log_evidence (P,) since then."""

    poses: np.ndarray
    covariances: np.ndarray
    log_prior: np.ndarray
    log_evidence: np.ndarray

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def probabilities(self) -> np.ndarray:
        """(P,)."""
        log_mass = self.log_prior + self.log_evidence
        mass = np.exp(log_mass - log_mass.max())
        return mass / mass.sum()

    def some(self, index: np.ndarray) -> Hypotheses:
        """Those of an index or mask."""
        return Hypotheses(*(each[index] for each in vars(self).values()))

    def moved(self, motion: np.ndarray) -> Hypotheses:
        """After the gel moved by `motion` (4, 4)."""
        return replace(self, poses=self.poses @ motion, covariances=transform_covariance(self.covariances, motion))

    def or_else(self, others: Hypotheses, change: float) -> Hypotheses:
        """Beside others, one of which holds by the probability `change`; what is believed becomes the prior."""
        with np.errstate(divide="ignore"):
            mine = np.log1p(-change) + np.log(self.probabilities)
        prior = np.concatenate([mine, np.log(change) + others.log_prior])
        pairs = ((self.poses, others.poses), (self.covariances, others.covariances))
        return Hypotheses(*map(np.concatenate, pairs), prior, np.zeros(len(prior)))

    def likely(self, odds: float) -> Hypotheses:
        """Those whose log-odds against the most probable one are no less than that."""
        log_mass = self.log_prior + self.log_evidence
        return self.some(log_mass >= log_mass.max() + odds)

    def merged(self, symmetry: Symmetry) -> Hypotheses:
        """One in place of all that have met, modulo symmetry: the most probable, with the prior of all."""
        order = np.argsort(-(self.log_prior + self.log_evidence), kind="stable")
        poses = symmetry.nearest(self.poses, self.poses[order[0]])
        # the Frobenius norm between rotations is sqrt(2) times their angle, while that is small
        turned = poses[:, :3, :3].reshape(-1, 9) / (np.sqrt(2) * _SAME_R)
        features = np.concatenate([poses[:, :3, 3] / _SAME_T, turned], axis=1)
        near = cKDTree(features).query_ball_point(features, 1.0)
        log_prior, kept, free = self.log_prior.copy(), [], np.ones(len(self), bool)
        for i in order:
            if free[i]:
                met = [j for j in near[i] if free[j]]
                log_prior[i] = np.logaddexp.reduce(self.log_prior[met])
                free[met] = False
                kept.append(i)
        return replace(self, poses=poses, log_prior=log_prior).some(np.array(kept))


@dataclass(frozen=True)
class Posterior:
    """What the observer believes after a keyframe.

    pose (4, 4): that with the most probability around it, and probability, that within the yardstick of it; hypotheses,
    all that are left; credible: how many of them hold 99 %.
    """

    pose: np.ndarray
    probability: float
    hypotheses: Hypotheses
    credible: int


class IdealObserver:
    """On one object, over one slide.

    Args: model of the object; noise; yardstick, within which poses are one answer; evidence, one of `EVIDENCE`; prior,
    of the start, None if nothing is known; dropped, as `_DROPPED`.
    Raises InputError if the codebook does not say what maps are measured at its poses.
    """

    def __init__(
        self,
        model: ObjectModel,
        noise: NoiseModel,
        yardstick: Yardstick,
        evidence: str = "maps",
        prior: Prior | None = None,
        dropped: float = _DROPPED,
    ):
        if model.alignment is None:
            raise InputError("codebook: does not name its sensor, so no map can be compared; build it again")
        self._model, self._noise, self._yardstick = model, noise, yardstick
        self._by_maps, self._by_codes = evidence != "codes", evidence != "maps"
        self._symmetry, self._effort = model.symmetry.exact, Effort()
        self._search = CompetitorSearch(model.lookup, self._symmetry, noise, self._effort)
        self._odds = float(np.log(dropped / len(model.lookup))) if dropped else -np.inf
        config = model.config
        self._window = KeyframeWindow(
            config.smoothing_touches, config.smoothing_spacing, noise.touch_correlation, self._effort.shortlist
        )
        self._keyframes: list[Keyframe] = []  # all of them: none is measured a second time as if it were new
        self._hypotheses = self._anywhere(prior)

    def step(self, odometry: np.ndarray | None, measurement: Measurement) -> Posterior | None:
        """Take a frame; odometry (4, 4) since the last one, None at first. What is believed, at each keyframe."""
        if odometry is not None:
            motion = Odometry.from_matrix(odometry)
            self._window.moved(motion.transform, motion.path, measurement.in_contact)
        if not (measurement.in_contact and self._window.due):
            return None
        code = self._model.measurement.unit_code(measurement.code)
        self._window.keep([replace(measurement, code=code)], [self._model.measurement.log_ratio_of(measurement)])
        self._take(self._window.keyframes[-1])
        return self._posterior()

    def _anywhere(self, prior: Prior | None = None) -> Hypotheses:
        """All poses of the codebook, as likely as each other but for the prior."""
        poses = self._model.lookup.poses
        log_prior = np.zeros(len(poses))
        if prior is not None:
            log_prior = prior.log_density(poses, self._noise.prior_floor, self._symmetry)
        log_prior -= np.logaddexp.reduce(log_prior)
        covariances = np.tile(self._noise.between_entries, (len(poses), 1, 1))
        return Hypotheses(poses, covariances, log_prior, np.zeros(len(poses)))

    def _take(self, keyframe: Keyframe) -> None:
        hypotheses = self._hypotheses
        if self._keyframes:
            last = self._keyframes[-1]
            hypotheses = hypotheses.moved(se3.inverse(last.motion) @ keyframe.motion)
            if keyframe.stretch > last.stretch:
                hypotheses = hypotheses.or_else(self._anywhere(), self._noise.change_lifted)
        self._keyframes.append(keyframe)
        weight = independence(self._keyframes, self._noise.touch_correlation)[-1]
        gain = np.zeros(len(hypotheses))
        if self._by_codes:
            gain += self._search.along(hypotheses.poses, [keyframe] * len(hypotheses))
        if self._by_maps:
            hypotheses, residual_ratio = self._aligned(hypotheses, keyframe)
            gain += self._noise.residual_evidence(residual_ratio)
        hypotheses = replace(hypotheses, log_evidence=hypotheses.log_evidence + weight * gain)
        self._hypotheses = hypotheses.likely(self._odds).merged(self._symmetry)

    def _aligned(self, hypotheses: Hypotheses, keyframe: Keyframe) -> tuple[Hypotheses, np.ndarray]:
        """Hypotheses after a keyframe's map, and the fraction (P,) of it that each leaves unexplained."""
        jitter, touches = self._noise.jitter, keyframe.maps(settled=True)
        poses, covariances = hypotheses.poses.copy(), hypotheses.covariances.copy()
        residual_ratio = np.ones(len(poses))
        for i, (pose, covariance) in enumerate(zip(hypotheses.poses, hypotheses.covariances, strict=True)):
            found = self._settled(pose, covariance + jitter, touches)
            residual_ratio[i] = 1.0 - found.fit
            if found.fit > self._model.config.penetration_fit:
                poses[i], covariances[i] = without_jitter(pose, covariance, jitter, found)
        return replace(hypotheses, poses=poses, covariances=covariances), residual_ratio

    def _settled(self, pose: np.ndarray, covariance: np.ndarray, touches: Sequence[Measurement]) -> Aligned:
        """Aligned until no more is explained: an entry would else fall behind by how far from its optimum it is."""
        align, error = self._model.alignment, self._noise.finger_error
        found = align_in_turn(align, pose, covariance, touches, error)
        while True:
            again = align_in_turn(align, pose, covariance, touches, error, start=found.pose)
            if again.fit < found.fit + _MORE:
                return max(found, again, key=lambda each: each.fit)
            found = again

    def _posterior(self) -> Posterior:
        poses, probabilities = self._hypotheses.poses, self._hypotheses.probabilities
        order = np.argsort(-probabilities, kind="stable")
        around = [float(probabilities[self._yardstick.right(poses, poses[i])].sum()) for i in order[:_LEADING]]
        best = int(np.argmax(around))
        credible = int(np.searchsorted(np.cumsum(probabilities[order]), KNOWN)) + 1
        return Posterior(poses[order[best]], around[best], self._hypotheses, min(credible, len(order)))


def observe(observer: IdealObserver, frames: Sequence[TrialFrame]) -> Iterator[tuple[int, Posterior]]:
    """What is believed at each keyframe of a slide, with its position among the frames."""
    for k, (frame, odometry) in enumerate(with_odometry(frames)):
        if (found := observer.step(odometry, frame.measurement)) is not None:
            yield k, found
