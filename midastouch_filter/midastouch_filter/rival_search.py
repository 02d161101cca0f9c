"""Which places on the whole object explain the last touches by their codes?"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from midastouch_perception import se3

from .effort import Effort
from .keyframes import Keyframe
from .lookup import PoseLookup
from .noise_model import NoiseModel
from .places import is_apart
from .touch import Measurement

_OFF = 0.01  # m from any entry, where a finger can touch nothing; 1 rad counts as 10 mm
_AXES = np.concatenate([np.zeros((1, 6)), np.eye(6)[3:], -np.eye(6)[3:]])

Rivals = tuple[list[np.ndarray], bool]


class RivalSearch:
    """Looks for the places that explain keyframes best, in slices: each generator yields None between two of them.

    Args: lookup; poses (M, 4, 4) of its entries; tempering exponent of a keyframe; noise; effort.
    """

    def __init__(self, lookup: PoseLookup, poses: np.ndarray, tempering: float, noise: NoiseModel, effort: Effort):
        self._lookup, self._poses, self._tempering = lookup, poses, tempering
        self._margin, self._effort = noise.code_margin, effort

    def find(self, keyframes: list[Keyframe], taken: Sequence[np.ndarray]) -> Generator[None, None, Rivals]:
        """Poses (4, 4) at the newest keyframe, apart from `taken` and each other, best first; whether these are all."""
        effort, newest = self._effort, keyframes[-1]
        candidates = yield from self._candidates(keyframes)
        some = keyframes[:: -max(len(keyframes) // effort.sieve, 1)]
        candidates, _ = self._best(candidates, (yield from self._summed(candidates, newest, some)))
        if any(len(keyframe.touches) > 1 for keyframe in keyframes):
            for angle in effort.turns:
                yield None
                candidates = self._turned(candidates[: effort.turned], angle, newest, some)
        candidates, score = self._best(candidates, (yield from self._summed(candidates, newest, keyframes)))
        return self._worth_replaying(candidates, score, taken)

    def _candidates(self, keyframes: list[Keyframe]) -> Generator[None, None, np.ndarray]:
        """Poses (C, 4, 4) at the newest keyframe of the entries that fit best in any of them."""
        newest, out = keyframes[-1].motion, []
        for keyframe in keyframes:
            to_newest = se3.inverse(keyframe.motion) @ newest
            for touch, best in zip(keyframe.touches, keyframe.shortlists, strict=True):
                poses = self._poses[best]
                if touch.T_gel_finger is not None:
                    poses = poses @ se3.inverse(touch.T_gel_finger)
                out.append(poses @ to_newest)
        poses = np.concatenate(out)
        entries = np.empty(len(poses), int)
        for part in self._slices(len(poses)):
            yield None
            entries[part] = self._lookup.exact(poses[part])
        return poses[np.unique(entries, return_index=True)[1]]

    def _slices(self, count: int) -> list[slice]:
        """What is looked up in one step each."""
        size = self._effort.lookups_per_step
        return [slice(low, low + size) for low in range(0, count, size)]

    def _best(self, candidates: np.ndarray, score: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The best candidates and their scores, best first."""
        best = np.argsort(-score, kind="stable")[: self._effort.kept]
        return candidates[best], score[best]

    def _turned(self, candidates: np.ndarray, angle: float, newest: Keyframe, keyframes: list[Keyframe]) -> np.ndarray:
        """Each of the candidates (C, 4, 4), turned by `angle` about one of its axes if that explains the keyframes."""
        turned = candidates[:, None] @ se3.exp(angle * _AXES)
        every = turned.reshape(-1, 4, 4)
        score = sum(self._scores(every @ (se3.inverse(newest.motion) @ each.motion), each) for each in keyframes)
        return turned[np.arange(len(turned)), score.reshape(len(turned), -1).argmax(axis=1)]

    def _summed(
        self, candidates: np.ndarray, newest: Keyframe, keyframes: list[Keyframe]
    ) -> Generator[None, None, np.ndarray]:
        """Scores (C,) of candidates (C, 4, 4) at the newest keyframe, over these keyframes."""
        score = np.zeros(len(candidates))
        for keyframe in keyframes:
            motion = se3.inverse(newest.motion) @ keyframe.motion
            for part in self._slices(len(candidates)):
                yield None
                score[part] += self._scores(candidates[part] @ motion, keyframe)
        return score

    def _scores(self, poses: np.ndarray, keyframe: Keyframe) -> np.ndarray:
        """Tempered log-likelihood ratios (C,) of poses (C, 4, 4) at a keyframe, of all its fingers."""
        out = np.zeros(len(poses))
        for touch, log_ratio in zip(keyframe.touches, keyframe.log_ratios, strict=True):
            out += self._tempering * self._log_ratio(poses, touch, log_ratio)
        return out

    def _log_ratio(self, poses: np.ndarray, touch: Measurement, log_ratio: np.ndarray) -> np.ndarray:
        """(C,) of poses (C, 4, 4) of the first finger; where a finger would be off the surface, its worst."""
        if touch.T_gel_finger is None:
            return log_ratio[self._lookup.exact(poses)].astype(float)
        entries = self._lookup.exact(poses @ touch.T_gel_finger, within=_OFF)
        return np.append(log_ratio, log_ratio.min())[entries].astype(float)

    def _worth_replaying(self, candidates: np.ndarray, score: np.ndarray, taken: Sequence[np.ndarray]) -> Rivals:
        chosen: list[np.ndarray] = []
        for i in np.argsort(-score, kind="stable"):
            if score[i] < score.max() - self._margin:
                break
            if is_apart(candidates[i], [*taken, *chosen]):
                if len(chosen) == self._effort.most_rivals:
                    return chosen, False
                chosen.append(candidates[i])
        return chosen, True
