"""How well a pose hypothesis explains the penetration maps of a window of keyframes, map by map, and which hypothesis
explains the touches at present.

Alignment along the path gives the evidence of each map. If the object may have been moved between any two touches, the
posterior is that of a hidden Markov model over hypotheses: the forward recursion of Bayesian change-point detection
(Adams and MacKay 2007) with the hypotheses as states. Touch by touch a hypothesis keeps what it held, unless the motion
was broken before the touch: then it is anywhere. One more state stands for all hypotheses that were not named.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from midastouch_common import se3

from ..core.alignment import Aligned, PenetrationAlignment, align_until_settled, transform_covariance, without_jitter
from ..core.keyframes import Keyframe, WeighedWindow
from ..core.noise_model import Effort, NoiseModel
from ..core.pose_hypothesis import another, pose_distance
from ..core.touch import Measurement
from .pace import Pace

_WORSE = 0.01  # fraction of a map by which a start may explain less than it did, and no other is tried


@dataclass(frozen=True)
class Followed:
    """A hypothesis: pose (4, 4) and covariance (6, 6), own frame, at keyframe number `at`, by all maps from there on.

    residual_ratio (K,): fraction of each map that it leaves unexplained, 1 before that; poses (K, 4, 4) and priors (K,
    6, 6), own frames, before each map was used; aligned (K, 4, 4), after.
    """

    pose: np.ndarray
    covariance: np.ndarray
    at: int
    residual_ratio: np.ndarray
    poses: np.ndarray
    priors: np.ndarray
    aligned: np.ndarray

    def squared_innovation(self) -> np.ndarray:
        """(K,) squared Mahalanobis distances by which it gave way to each map; 0 for those that were not used."""
        offset = se3.log(se3.inverse(self.poses) @ self.aligned)
        return np.einsum("ki,kij,kj->k", offset, np.linalg.inv(self.priors), offset)


class Alignments:
    """Where hypotheses were aligned to the keyframes of an earlier window."""

    def __init__(self, followed: Sequence[Followed] = (), keyframes: Sequence[Keyframe] = ()):
        # with the keyframe itself, so that no other one gets its id
        self._of = {
            id(keyframe): (
                keyframe,
                np.array([1.0 - each.residual_ratio[k] for each in followed if each.at <= k]),
                np.array([each.aligned[k] for each in followed if each.at <= k]).reshape(-1, 4, 4),
            )
            for k, keyframe in enumerate(keyframes)
        }

    def near(self, keyframe: Keyframe, pose: np.ndarray) -> tuple[float, np.ndarray] | None:
        """Fit and pose (4, 4) of the one that explained this keyframe best among those near `pose` (4, 4), if any."""
        fits, poses = self._at(keyframe)
        near = np.flatnonzero(~another()(poses, pose))
        if not len(near):
            return None
        best = near[fits[near].argmax()]
        return float(fits[best]), poses[best]

    def better(
        self, keyframe: Keyframe, fit: float, pose: np.ndarray, covariance: np.ndarray, within: float
    ) -> np.ndarray | None:
        """Pose (4, 4) of the one that explained this keyframe best, if more than `fit` of it, among those within a
        squared Mahalanobis distance of N(pose (4, 4), covariance (6, 6), own frame)."""
        fits, poses = self._at(keyframe)
        some = np.flatnonzero(fits > fit)
        if not len(some):
            return None
        offset = se3.log(se3.inverse(pose) @ poses[some])
        some = some[np.einsum("ni,ij,nj->n", offset, np.linalg.inv(covariance), offset) < within]
        return poses[some[fits[some].argmax()]] if len(some) else None

    def _at(self, keyframe: Keyframe) -> tuple[np.ndarray, np.ndarray]:
        """Fits (N,) and poses (N, 4, 4) at a keyframe."""
        _, fits, poses = self._of.get(id(keyframe), (keyframe, np.empty(0), np.empty((0, 4, 4))))
        return fits, poses


class Race:
    """What the likelihoods of one window share, be it on several objects.

    Args: window; pace, None for what is done at once.
    Attributes: best (K,), highest sum so far of the evidence from each keyframe on; alignments, number of them.
    """

    def __init__(self, window: WeighedWindow, pace: Pace | None = None):
        self.best, self.alignments = np.full(len(window.keyframes), -np.inf), 0
        self._pace, self._in_frame = pace, 0

    def used_up_by(self, alignments: int) -> bool:
        """Count so many alignments that were done; whether the next ones have to wait for the next frame."""
        self.alignments += alignments
        self._in_frame += alignments
        if self._pace is None or self._pace.leaves(self._in_frame, self._pace.alignments):
            return False
        self._in_frame = max(self._in_frame - self._pace.alignments, 0)
        return True


class WindowLikelihood:
    """Aligns hypotheses to all keyframes, from the newest back along the path.

    Args: window; alignment; noise; effort; explains: fit from which a map may correct a pose; race, in which hypotheses
    that fall far behind are given up; known, alignments to the same keyframes before.
    Attributes: followed, so far.
    """

    def __init__(
        self,
        window: WeighedWindow,
        alignment: PenetrationAlignment,
        noise: NoiseModel,
        effort: Effort,
        explains: float,
        race: Race,
        known: Alignments | None = None,
    ):
        self._window, self._alignment = window, alignment
        self._noise, self._effort, self._explains = noise, effort, explains
        # nearer to each other than entries of the codebook, where they start from, two have become one
        self._same = float(np.sqrt(noise.between_entries[0, 0]))
        self.followed: list[Followed] = []
        self._race, self._known = race, known or Alignments()

    def follow(self, start: np.ndarray) -> Iterator[None]:
        """Align `start` (4, 4) at the newest keyframe to all of them, in slices, as long as there is hope.

        First to the newest few, and then once more from there: a codebook's entry would else fall behind a settled mode
        by how far from the optimum it starts. A start that has reached another hypothesis by then is dropped.
        """
        newest = len(self._window.keyframes) - 1
        few = max(newest - self._effort.settled_after, 0)
        found = yield from self._back_to(few, start)
        others = np.array([each.poses[few] for each in self.followed if each.at <= few]).reshape(-1, 4, 4)
        if found.at <= few and (pose_distance(others, found.poses[few]) < self._same).any():
            return
        if few and found.at == few:
            onward = se3.inverse(self._window.keyframes[few].motion) @ self._window.keyframes[newest].motion
            found = yield from self._back_to(0, found.pose @ onward)
        self.followed.append(found)

    def follow_again(self, start: np.ndarray) -> Iterator[None]:
        """Align `start` (4, 4) at the newest keyframe, where a hypothesis ended, to all of them."""
        self.followed.append((yield from self._back_to(0, start)))

    def _back_to(self, oldest: int, pose: np.ndarray) -> Generator[None, None, Followed]:
        """Align a pose (4, 4) at the newest keyframe to those from number `oldest` on, as long as there is hope."""
        keyframes, weights, jitter = self._window.keyframes, self._window.weights, self._noise.jitter
        covariance = self._noise.between_entries
        residual_ratio, poses, total = np.ones(len(keyframes)), np.tile(pose, (len(keyframes), 1, 1)), 0.0
        priors, posteriors = np.tile(covariance + jitter, (len(keyframes), 1, 1)), poses.copy()
        for k in range(len(keyframes) - 1, oldest - 1, -1):
            maps = keyframes[k].maps(settled=len(keyframes) - k > self._effort.settled_after)
            aligned, descents = self._aligned(keyframes[k], pose, covariance + jitter, maps)
            residual_ratio[k], poses[k] = 1.0 - aligned.fit, pose
            priors[k], posteriors[k] = covariance + jitter, aligned.pose
            total += weights[k] * float(self._noise.residual_evidence(residual_ratio[k]))
            if aligned.fit > self._explains:
                slope = self._noise.evidence_slope(residual_ratio[k])
                aligned = self._alignment.of_unknown_scale(pose, covariance + jitter, maps, aligned, slope)
                pose, covariance = without_jitter(pose, covariance, jitter, aligned)
            if self._race.used_up_by(descents):
                yield None
            hopeless = total - self._race.best[k] < self._noise.refuted
            self._race.best[k] = max(self._race.best[k], total)
            if hopeless or k == oldest:
                break
            back = se3.inverse(keyframes[k].motion) @ keyframes[k - 1].motion
            pose, covariance = pose @ back, transform_covariance(covariance, back)
        return Followed(pose, covariance, k, residual_ratio, poses, priors, posteriors)

    def _aligned(
        self, keyframe: Keyframe, pose: np.ndarray, covariance: np.ndarray, maps: list[Measurement]
    ) -> tuple[Aligned, int]:
        """The prior's posterior by the maps of a keyframe, and how many descents that took.

        Where a hypothesis was aligned to the keyframe before, that is where the optimum is looked for first. The prior
        that touches of a plane leave is wide, and a descent from its middle may go astray: so last where one was that
        the prior does not exclude.
        """
        settle = partial(align_until_settled, self._alignment, pose, covariance, maps, self._noise.finger_error)
        near = self._known.near(keyframe, pose)
        found = [settle(None if near is None else near[1])]
        if near is not None and found[0][0].fit < near[0] - _WORSE:
            found.append(settle())
        most = max(aligned.fit for aligned, _ in found)
        better = self._known.better(keyframe, most + _WORSE, pose, covariance, self._noise.elsewhere)
        if better is not None:
            found.append(settle(better))
        best, _ = max(found, key=lambda each: each[0].fit)
        return best, sum(descents for _, descents in found)

    def ended(self, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses (P, 4, 4) of the hypotheses by all their maps, when the gel had moved by `motion` (4, 4) since the
        start, and motions (P, 4, 4) to there from where each was followed to."""
        reached = np.array([self._window.keyframes[each.at].motion for each in self.followed]).reshape(-1, 4, 4)
        onward = se3.inverse(reached) @ motion
        return np.array([each.pose for each in self.followed]).reshape(-1, 4, 4) @ onward, onward

    def evidence(self, code_ratios: Callable[[np.ndarray, Sequence[Keyframe]], np.ndarray]) -> np.ndarray:
        """(P, K) nats of each keyframe for each hypothesis that was followed, against one that was not named.

        code_ratios(poses, keyframes): log-likelihood ratios (K,) of the codes of each at a pose (K, 4, 4).
        They say how likely it is that one of these hypotheses is right at all; maps decide between them.
        """
        residual_ratio = np.stack([each.residual_ratio for each in self.followed])
        best, touches = residual_ratio.argmin(axis=0), np.arange(residual_ratio.shape[1])
        poses = np.stack([self.followed[i].poses[k] for k, i in enumerate(best)])
        against_best = self._noise.residual_evidence(residual_ratio) - self._noise.residual_evidence(
            residual_ratio[best, touches]
        )
        codes = code_ratios(poses, self._window.keyframes)
        return self._window.weights * (codes + against_best) - self._window.chance()


def hypothesis_posterior(
    evidence: np.ndarray, log_prior: np.ndarray, log_arrival: np.ndarray, change: np.ndarray
) -> tuple[np.ndarray, float]:
    """Probabilities (P,) of P hypotheses at the newest of K touches, and that of all unnamed ones together.

    evidence (P, K) nats of each touch, oldest first, for each hypothesis against an unnamed one; log_prior,
    log_arrival (P + 1,) of each hypothesis at the first touch and after a broken motion, the unnamed ones last;
    change (K,): probability that the motion was broken before a touch.
    """
    belief = log_prior
    gains = np.vstack([evidence, np.zeros((1, evidence.shape[1]))])
    for k, broken in enumerate(change):
        belief = belief - np.logaddexp.reduce(belief)
        if k:
            belief = np.logaddexp(belief + np.log1p(-broken), np.log(broken) + log_arrival)
        belief = belief + gains[:, k]
    probability = np.exp(belief - np.logaddexp.reduce(belief))
    return probability[:-1], float(probability[-1])
