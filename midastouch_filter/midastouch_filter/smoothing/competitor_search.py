"""Which hypotheses on the whole object explain the last touches by their codes?"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3
from midastouch_perception.symmetry.group import Symmetry

from ..core.keyframes import Keyframe, WeighedWindow
from ..core.lookup import NearestEntry, PoseLookup
from ..core.noise_model import Effort, NoiseModel
from ..core.pose_hypothesis import distinct, far_from, farther
from ..core.touch import Measurement
from .pace import Pace

_OFF_SURFACE = 0.01  # m from any entry, where a finger can touch nothing; 1 rad counts as 10 mm
_BASIN = 0.008  # m: alignment ends at the same optimum from anywhere within; 1 rad counts as 10 mm
ENTRIES_AROUND = 8
"""Entries beside the one nearest to a pose, any of which may have the code of a touch there."""
_AXES = np.concatenate([np.zeros((1, 6)), np.eye(6)[3:], -np.eye(6)[3:]])


@dataclass(frozen=True)
class Competitors:
    """Hypotheses that compete with the filter's modes.

    poses: (4, 4) of each at the newest keyframe; by turns the next best by all touches, and by those since the last
    lift. scores: nats of each, the larger of the two. lasting: number of the first poses that hold all that are good by
    all touches. cloud (C, 4, 4): every pose that may explain the touches, at the newest keyframe, and cloud_scores (C,)
    in nats.
    """

    poses: list[np.ndarray]
    scores: list[float]
    lasting: int
    cloud: np.ndarray
    cloud_scores: np.ndarray


class CompetitorSearch:
    """Looks for the hypotheses that explain keyframes best, in slices: each generator yields None between two of them.

    Args: lookup; without neighbours the nearest entry speaks for a pose, and there is no `along`; symmetry, modulo
    which hypotheses differ; noise; effort; pace, if other searches share it.
    """

    def __init__(
        self,
        lookup: NearestEntry | PoseLookup,
        symmetry: Symmetry,
        noise: NoiseModel,
        effort: Effort,
        pace: Pace | None = None,
    ):
        self._lookup, self._symmetry = lookup, symmetry
        self._margin, self._effort = noise.code_margin, effort
        self._pace = pace or Pace(effort)

    def find(self, window: WeighedWindow, taken: Sequence[np.ndarray]) -> Generator[None, None, Competitors]:
        """The competitors of `taken`, poses (4, 4) at the newest keyframe, by the touches of the window."""
        effort, newest, some = self._effort, window.keyframes[-1], window.sparser(self._effort.sieve)
        candidates = yield from self._candidates(some.keyframes)
        candidates, *_ = self._best(candidates, *(yield from self._scored(candidates, newest, some)))
        if any(len(keyframe.touches) > 1 for keyframe in window.keyframes):
            for angle in effort.turns:
                yield None
                candidates = self._turned(candidates[: effort.turned], angle, newest, some)
        candidates, *scores = self._best(candidates, *(yield from self._scored(candidates, newest, window)))
        return self._worth_following(candidates, *scores, taken)

    def _candidates(self, keyframes: list[Keyframe]) -> Generator[None, None, np.ndarray]:
        """Poses (C, 4, 4) at the newest keyframe of the entries that fit best in any of them."""
        newest, out = keyframes[-1].motion, []
        for keyframe in keyframes:
            to_newest = se3.inverse(keyframe.motion) @ newest
            for touch, best in zip(keyframe.touches, keyframe.shortlists, strict=True):
                poses = self._lookup.poses[best]
                if touch.T_gel_finger is not None:
                    poses = poses @ se3.inverse(touch.T_gel_finger)
                out.append(poses @ to_newest)
        poses = np.concatenate(out)
        entries = np.empty(len(poses), int)
        for part in self._slices(len(poses)):
            yield from self._pause(part)
            entries[part] = self._lookup.exact(poses[part])
        return poses[np.unique(entries, return_index=True)[1]]

    def _pause(self, part: slice) -> Iterator[None]:
        """Yield None before `part` is looked up, if that has to wait for the next frame."""
        if self._pace.used_up_by(part.stop - part.start):
            yield None

    def _slices(self, count: int) -> list[slice]:
        """What is looked up at once: no more than in one frame."""
        size = self._pace.lookups
        return [slice(low, min(low + size, count)) for low in range(0, count, size)]

    def _best(self, candidates: np.ndarray, score: np.ndarray, recent: np.ndarray) -> tuple[np.ndarray, ...]:
        """The best candidates and both of their scores; by turns the next best of either.

        The object may have been moved then, and what explained many touches before may explain none any more.
        """
        turns = np.stack([np.argsort(-each, kind="stable") for each in (score, recent)], axis=1).ravel()
        best = turns[np.sort(np.unique(turns, return_index=True)[1])][: self._effort.kept]
        return candidates[best], score[best], recent[best]

    def _turned(self, candidates: np.ndarray, angle: float, newest: Keyframe, window: WeighedWindow) -> np.ndarray:
        """Each of the candidates (C, 4, 4), turned by `angle` about one of its axes if that explains the keyframes."""
        turned = candidates[:, None] @ se3.exp(angle * _AXES)
        every = turned.reshape(-1, 4, 4)
        scores = [self._of(every, newest, window, k) for k in range(len(window.weights))]
        score = window.best_suffix(np.stack(scores, axis=1))
        return turned[np.arange(len(turned)), score.reshape(len(turned), -1).argmax(axis=1)]

    def _scored(
        self, candidates: np.ndarray, newest: Keyframe, window: WeighedWindow
    ) -> Generator[None, None, tuple[np.ndarray, np.ndarray]]:
        """Scores (C,) of candidates (C, 4, 4) at the newest keyframe: over the window, and since the last lift."""
        scores = np.zeros((len(candidates), len(window.weights)))
        for k in range(len(window.weights)):
            for part in self._slices(len(candidates)):
                yield from self._pause(part)
                scores[part, k] = self._of(candidates[part], newest, window, k)
        recent = [keyframe.stretch == newest.stretch for keyframe in window.keyframes]
        best = window.best_suffix(scores)
        return best, best if all(recent) else scores[:, recent].sum(axis=1)

    def _of(self, candidates: np.ndarray, newest: Keyframe, window: WeighedWindow, k: int) -> np.ndarray:
        """Tempered log-likelihood ratios (C,) of candidates (C, 4, 4) at the newest keyframe, by keyframe k."""
        keyframe = window.keyframes[k]
        poses = candidates @ (se3.inverse(newest.motion) @ keyframe.motion)
        pairs = zip(keyframe.touches, keyframe.log_ratios, strict=True)
        return window.weights[k] * np.sum([self._log_ratio(poses, *pair) for pair in pairs], axis=0)

    def along(self, poses: np.ndarray, keyframes: Sequence[Keyframe]) -> np.ndarray:
        """Log-likelihood ratios (K,) of poses (K, 4, 4) of the first gel, each at its keyframe, of all fingers' codes.

        The codes of the first finger are scored in one call, since looking up a hundred poses takes as long as one.
        """
        out, around = np.zeros(len(poses)), self._nearby(poses)
        for k, keyframe in enumerate(keyframes):
            for touch, log_ratio in zip(keyframe.touches, keyframe.log_ratios, strict=True):
                if touch.T_gel_finger is None:
                    out[k] += log_ratio[around[k]].max()
                else:
                    out[k] += self._log_ratio(poses[k : k + 1], touch, log_ratio)[0]
        return out

    def _log_ratio(self, poses: np.ndarray, touch: Measurement, log_ratio: np.ndarray) -> np.ndarray:
        """(C,) of poses (C, 4, 4) of the first finger; where a finger would be off the surface, its worst.

        The best of the entries around a pose counts, since the pose lies between them.
        """
        if touch.T_gel_finger is None:
            return log_ratio[self._nearby(poses)].max(axis=1).astype(float)
        entries = self._lookup.exact(poses @ touch.T_gel_finger, within=_OFF_SURFACE)
        return np.append(log_ratio, log_ratio.min())[entries].astype(float)

    def _nearby(self, poses: np.ndarray) -> np.ndarray:
        """(C, 1 + neighbours) entries nearest to poses (C, 4, 4), the very nearest first."""
        entries = self._lookup.exact(poses)
        if isinstance(self._lookup, PoseLookup):
            return self._lookup.around(entries, 1 + ENTRIES_AROUND)
        return entries[:, None]

    def _worth_following(
        self, candidates: np.ndarray, score: np.ndarray, recent: np.ndarray, taken: Sequence[np.ndarray]
    ) -> Competitors:
        lasting, recently = (by > by.max() - self._margin for by in (score, recent))
        elsewhere = farther(_BASIN, self._symmetry)
        competitors = (lasting | recently) & far_from(taken, candidates, elsewhere)
        chosen = distinct(candidates, np.flatnonzero(competitors), elsewhere)
        scores = np.maximum(score, recent)[chosen]
        until = max((k + 1 for k, i in enumerate(chosen) if lasting[i]), default=0)
        return Competitors(list(candidates[chosen]), scores.tolist(), until, candidates, score)
