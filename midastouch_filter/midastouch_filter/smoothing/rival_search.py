"""Which places on the whole object explain the last touches by their codes?"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3

from ..core.keyframes import Keyframe, independence
from ..core.lookup import NearestEntry, PoseLookup
from ..core.noise_model import Effort, NoiseModel
from ..core.places import ANOTHER, APART, distinct, far_from
from ..core.touch import Measurement

_OFF = 0.01  # m from any entry, where a finger can touch nothing; 1 rad counts as 10 mm
_AROUND = 8  # entries beside the nearest one
_SAMPLE = 2048  # entries that stand for the codebook
_AXES = np.concatenate([np.zeros((1, 6)), np.eye(6)[3:], -np.eye(6)[3:]])


@dataclass(frozen=True)
class Rivals:
    """poses: of places that are worth a look, (4, 4) at the newest keyframe, by turns the next best of all touches and
    of those since the last lift; scores: nats of each by whichever of the two praises it more; lasting: after so many
    of them all of the former have come; cloud (C, 4, 4): of everything that may explain the touches, there too, and
    cloud_scores (C,) nats."""

    poses: list[np.ndarray]
    scores: list[float]
    lasting: int
    cloud: np.ndarray
    cloud_scores: np.ndarray


@dataclass(frozen=True)
class Scored:
    """keyframes, oldest first; weights (K,): how much of an independent touch each is; change (K,): probability that
    the motion was broken before each."""

    keyframes: list[Keyframe]
    weights: np.ndarray
    change: np.ndarray

    @classmethod
    def of(cls, keyframes: list[Keyframe], noise: NoiseModel) -> Scored:
        """Weighed by how far apart they are; the motion may have been broken, above all where the sensor was lifted."""
        lifted = np.array([k > 0 and keyframes[k].stretch > keyframes[k - 1].stretch for k in range(len(keyframes))])
        change = np.where(lifted, noise.change_lifted, noise.change)
        return cls(keyframes, independence(keyframes, noise.touch_correlation), change)

    def sparser(self, count: int) -> Scored:
        """The newest one and, ever farther apart, so many in all."""
        last = len(self.keyframes) - 1
        chosen = sorted({max(last - 2**i + 1, 0) for i in range(count)})
        change = [self.change[low + 1 : k + 1].max(initial=0.0) for low, k in zip([-1, *chosen], chosen, strict=False)]
        return Scored([self.keyframes[k] for k in chosen], self.weights[chosen], np.array(change))

    def chance(self) -> np.ndarray:
        """(K,) nats that the codes of each touch, weighted, say of a place at random: their mean over the codebook."""
        return np.array(
            [
                sum(np.log(np.exp(weight * some[:: len(some) // _SAMPLE + 1]).mean()) for some in keyframe.log_ratios)
                for weight, keyframe in zip(self.weights, self.keyframes, strict=True)
            ]
        )

    def best_suffix(self, scores: np.ndarray) -> np.ndarray:
        """(C,) nats of all touches since the motion was last broken, wherever that explains candidates best.

        scores (C, K): of each touch.
        """
        price = np.append(0.0, np.log(self.change[1:]))
        return (np.cumsum(scores[:, ::-1], axis=1)[:, ::-1] + price).max(axis=1)


class Pace:
    """Says when a step has looked up enough, to whoever shares it; most: poses in one step."""

    def __init__(self, most: int):
        self.most, self._looked_up = most, 0

    def pause(self, part: slice) -> Iterator[None]:
        """Leave what is to be looked up to the next step, if this one has done enough."""
        self._looked_up += part.stop - part.start
        if self._looked_up > self.most:
            self._looked_up = part.stop - part.start
            yield None


class RivalSearch:
    """Looks for the places that explain keyframes best, in slices: each generator yields None between two of them.

    Args: lookup, which `along` needs with its neighbours; noise; effort; pace, if other searches share it.
    """

    def __init__(self, lookup: NearestEntry | PoseLookup, noise: NoiseModel, effort: Effort, pace: Pace | None = None):
        self._lookup = lookup
        self._margin, self._effort = noise.code_margin, effort
        self._pace = pace or Pace(effort.lookups_per_step)

    def find(self, window: Scored, taken: Sequence[np.ndarray]) -> Generator[None, None, Rivals]:
        """What may explain the touches of the window, apart from `taken` (poses (4, 4) at the newest keyframe)."""
        effort, newest, some = self._effort, window.keyframes[-1], window.sparser(self._effort.sieve)
        candidates = yield from self._candidates(some.keyframes)
        candidates, *_ = self._best(candidates, *(yield from self._scored(candidates, newest, some)))
        if any(len(keyframe.touches) > 1 for keyframe in window.keyframes):
            for angle in effort.turns:
                yield None
                candidates = self._turned(candidates[: effort.turned], angle, newest, some)
        candidates, *scores = self._best(candidates, *(yield from self._scored(candidates, newest, window)))
        return self._worth_replaying(candidates, *scores, taken)

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
            yield from self._pace.pause(part)
            entries[part] = self._lookup.exact(poses[part])
        return poses[np.unique(entries, return_index=True)[1]]

    def _slices(self, count: int) -> list[slice]:
        """What is looked up at once: no more than in one step."""
        size = self._pace.most
        return [slice(low, min(low + size, count)) for low in range(0, count, size)]

    def _best(self, candidates: np.ndarray, score: np.ndarray, recent: np.ndarray) -> tuple[np.ndarray, ...]:
        """The best candidates and both of their scores; by turns the next best of either.

        The object may have been moved then, and what explained many touches before may explain none any more.
        """
        turns = np.stack([np.argsort(-each, kind="stable") for each in (score, recent)], axis=1).ravel()
        best = turns[np.sort(np.unique(turns, return_index=True)[1])][: self._effort.kept]
        return candidates[best], score[best], recent[best]

    def _turned(self, candidates: np.ndarray, angle: float, newest: Keyframe, window: Scored) -> np.ndarray:
        """Each of the candidates (C, 4, 4), turned by `angle` about one of its axes if that explains the keyframes."""
        turned = candidates[:, None] @ se3.exp(angle * _AXES)
        every = turned.reshape(-1, 4, 4)
        scores = [self._of(every, newest, window, k) for k in range(len(window.weights))]
        score = window.best_suffix(np.stack(scores, axis=1))
        return turned[np.arange(len(turned)), score.reshape(len(turned), -1).argmax(axis=1)]

    def _scored(
        self, candidates: np.ndarray, newest: Keyframe, window: Scored
    ) -> Generator[None, None, tuple[np.ndarray, np.ndarray]]:
        """Scores (C,) of candidates (C, 4, 4) at the newest keyframe: over the window, and since the last lift."""
        scores = np.zeros((len(candidates), len(window.weights)))
        for k in range(len(window.weights)):
            for part in self._slices(len(candidates)):
                yield from self._pace.pause(part)
                scores[part, k] = self._of(candidates[part], newest, window, k)
        recent = [keyframe.stretch == newest.stretch for keyframe in window.keyframes]
        best = window.best_suffix(scores)
        return best, best if all(recent) else scores[:, recent].sum(axis=1)

    def _of(self, candidates: np.ndarray, newest: Keyframe, window: Scored, k: int) -> np.ndarray:
        """Tempered log-likelihood ratios (C,) of candidates (C, 4, 4) at the newest keyframe, by keyframe k."""
        keyframe = window.keyframes[k]
        poses = candidates @ (se3.inverse(newest.motion) @ keyframe.motion)
        pairs = zip(keyframe.touches, keyframe.log_ratios, strict=True)
        return window.weights[k] * np.sum([self._log_ratio(poses, *pair) for pair in pairs], axis=0)

    def along(self, poses: np.ndarray, keyframes: Sequence[Keyframe]) -> np.ndarray:
        """Log-likelihood ratios (K,) of poses (K, 4, 4) of the first gel, each at its keyframe, of all fingers' codes.

        The first finger's all at once: a look-up of one pose takes as long as one of a hundred. Of the entries around
        a pose the best counts: it lies between them.
        """
        out, entries = np.zeros(len(poses)), self._lookup.exact(poses)
        around = np.column_stack([entries, self._lookup.neighbours[entries, :_AROUND]])
        for k, keyframe in enumerate(keyframes):
            for touch, log_ratio in zip(keyframe.touches, keyframe.log_ratios, strict=True):
                if touch.T_gel_finger is None:
                    out[k] += log_ratio[around[k]].max()
                else:
                    out[k] += self._log_ratio(poses[k : k + 1], touch, log_ratio)[0]
        return out

    def _log_ratio(self, poses: np.ndarray, touch: Measurement, log_ratio: np.ndarray) -> np.ndarray:
        """(C,) of poses (C, 4, 4) of the first finger; where a finger would be off the surface, its worst."""
        if touch.T_gel_finger is None:
            return log_ratio[self._lookup.exact(poses)].astype(float)
        entries = self._lookup.exact(poses @ touch.T_gel_finger, within=_OFF)
        return np.append(log_ratio, log_ratio.min())[entries].astype(float)

    def _worth_replaying(
        self, candidates: np.ndarray, score: np.ndarray, recent: np.ndarray, taken: Sequence[np.ndarray]
    ) -> Rivals:
        lasting, recently = (by > by.max() - self._margin for by in (score, recent))
        rivals = (lasting | recently) & far_from(taken, candidates, ANOTHER)
        chosen = distinct(candidates, np.flatnonzero(rivals), APART)
        scores = np.maximum(score, recent)[chosen]
        until = max((k + 1 for k, i in enumerate(chosen) if lasting[i]), default=0)
        return Rivals(list(candidates[chosen]), scores.tolist(), until, candidates, score)
