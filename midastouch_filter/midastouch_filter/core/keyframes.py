"""A window of keyframes: the last touches, kept at a distance from each other along the path, ever sparser."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .noise_model import NoiseModel
from .pose_hypothesis import pose_distance
from .touch import Measurement

_LIFT_PATH = 0.01  # m of path without contact; less is a gap in a slide
_SAMPLE = 2048  # entries that stand for the codebook


@dataclass(frozen=True)
class Keyframe:
    """What fingers measured in one frame.

    motion (4, 4): of the first gel, from the start to this frame; touches of those in contact; log_ratios, for each
    (M,) of every codebook entry as that finger's pose; shortlists, for each (S,) the entries with the best of them;
    stretch: number of times the sensor was lifted before.
    """

    motion: np.ndarray
    touches: list[Measurement]
    log_ratios: list[np.ndarray]
    shortlists: list[np.ndarray]
    stretch: int

    @property
    def gels(self) -> list[np.ndarray]:
        """Poses (4, 4) of the gels that touch, in the frame where the first one started."""
        moved = (touch.T_gel_finger for touch in self.touches)
        return [self.motion if finger is None else self.motion @ finger for finger in moved]

    def maps(self, settled: bool) -> list[Measurement]:
        """Touches to align to: as long as the hypothesis is not settled, the first one's only."""
        found = [touch for touch in self.touches if touch.penetration is not None]
        return found if settled else found[:1]


class KeyframeWindow:
    """Keeps `length` keyframes, at least `spacing` [m] of path apart, each with a `shortlist` of that many entries.

    Rubbing one spot tells nothing new: a touch replaces one nearby, not older than the last lift. Of too
    many the oldest goes whose neighbours say together what it does, within `correlation` [m] of each other; if there is
    none before the first lift, the oldest of all: what was measured before says little once the object may have been
    moved.
    Attributes: motion (4, 4), of the first gel since the start; keyframes, oldest first; stretch, at present; lifted,
    whether the sensor was lifted between the last two touches that were kept.
    """

    def __init__(self, length: int, spacing: float, correlation: float, shortlist: int):
        self._length, self._spacing, self._shortlist = length, spacing, shortlist
        self._correlation = correlation
        self.restart()

    def restart(self) -> None:
        """Forget all."""
        self.motion = np.eye(4)
        self.keyframes: list[Keyframe] = []
        self._path, self._in_the_air, self.stretch = np.inf, 0.0, 0
        self.lifted = False

    def __len__(self) -> int:
        return len(self.keyframes)

    @property
    def touches(self) -> int:
        """Number of touches, those of all fingers."""
        return sum(len(keyframe.touches) for keyframe in self.keyframes)

    def moved(self, transform: np.ndarray, path: float, in_contact: bool) -> bool:
        """The first gel moved by `transform` (4, 4), which counts as `path` [m]; whether that was a lift."""
        self.motion = self.motion @ transform
        self._path += path
        before = self._in_the_air
        self._in_the_air = 0.0 if in_contact else before + path
        lifted = before <= _LIFT_PATH < self._in_the_air
        self.stretch += lifted
        return lifted

    @property
    def due(self) -> bool:
        """Whether the present touch is worth keeping."""
        return self._path >= self._spacing

    def keep(self, touches: list[Measurement], log_ratios: Sequence[np.ndarray]) -> None:
        """Keep what fingers measure at present, the first one first."""
        newest = Keyframe(self.motion, touches, *self._kept(log_ratios), self.stretch)
        self.lifted = len(self) > 0 and newest.stretch > self.keyframes[-1].stretch
        away = _distances([newest], [*self.keyframes, newest])[0, :-1]
        apart = [self.keyframes[k] for k in np.flatnonzero(away >= 0.5 * self._spacing)]
        self.keyframes = self._thinned([*apart, newest])
        self._path = 0.0

    def _thinned(self, keyframes: list[Keyframe]) -> list[Keyframe]:
        """All but one, if there are too many."""
        if len(keyframes) <= self._length:
            return keyframes
        bridged = _distances(keyframes[2:], keyframes).diagonal() <= self._correlation
        first = [each.stretch == keyframes[0].stretch for each in keyframes[:-2]]
        gone = next((k + 1 for k in np.flatnonzero(bridged & first)), 0)
        return keyframes[:gone] + keyframes[gone + 1 :]

    def take(self, other: KeyframeWindow, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        """Go on from where another window is, with as many of its keyframes as fit; `log_ratio_of` as `score_anew`."""
        self.motion, self.stretch = other.motion, other.stretch
        self._path, self._in_the_air = other._path, other._in_the_air
        self.keyframes = []
        for each in other.keyframes:
            self.keyframes = self._thinned([*self.keyframes, each])
        self.score_anew(log_ratio_of)

    def score_anew(self, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        """The codebook has other entries: `log_ratio_of` a touch, (M,), is that of each of these."""
        for k, keyframe in enumerate(self.keyframes):
            # each is valid until the next touch is scored
            self.keyframes[k] = self.scored(keyframe, [log_ratio_of(touch).copy() for touch in keyframe.touches])

    def scored(self, keyframe: Keyframe, log_ratios: Sequence[np.ndarray]) -> Keyframe:
        """A keyframe with other entries' log-ratios (M,), for each of its touches."""
        log_ratios, shortlists = self._kept(log_ratios)
        return replace(keyframe, log_ratios=log_ratios, shortlists=shortlists)

    def _kept(self, log_ratios: Sequence[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """`Keyframe.log_ratios` and `Keyframe.shortlists`."""
        rounded, count = [each.astype(np.float16) for each in log_ratios], self._shortlist // len(log_ratios)
        return rounded, [np.argpartition(-each, min(count, len(each) - 1))[:count] for each in rounded]


@dataclass(frozen=True)
class WeighedWindow:
    """keyframes, oldest first; weights (K,): how much of an independent touch each is; change (K,): probability that
    the motion was broken before each."""

    keyframes: list[Keyframe]
    weights: np.ndarray
    change: np.ndarray

    @classmethod
    def of(cls, keyframes: list[Keyframe], noise: NoiseModel) -> WeighedWindow:
        """Weighed by how far apart they are; the motion may have been broken, above all where the sensor was lifted."""
        lifted = np.array([k > 0 and keyframes[k].stretch > keyframes[k - 1].stretch for k in range(len(keyframes))])
        change = np.where(lifted, noise.change_lifted, noise.change)
        return cls(keyframes, independence(keyframes, noise.touch_correlation), change)

    def sparser(self, count: int) -> WeighedWindow:
        """`count` keyframes: the newest one and, ever farther apart, older ones."""
        last = len(self.keyframes) - 1
        chosen = sorted({max(last - 2**i + 1, 0) for i in range(count)})
        change = [self.change[low + 1 : k + 1].max(initial=0.0) for low, k in zip([-1, *chosen], chosen, strict=False)]
        return WeighedWindow([self.keyframes[k] for k in chosen], self.weights[chosen], np.array(change))

    def chance(self) -> np.ndarray:
        """(K,) nats that the codes of each touch, weighted, say of a pose at random: their mean over the codebook."""
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


def independence(keyframes: Sequence[Keyframe], correlation: float) -> np.ndarray:
    """How much of an independent touch each of K keyframes, oldest first, is (K,), in [0, 1].

    The fraction of the correlation length [m] that it lies away from the nearest older one.
    """
    away = _distances(keyframes, keyframes)
    away[np.triu_indices(len(keyframes))] = np.inf
    return np.minimum(away.min(axis=1) / correlation, 1.0)


def _distances(newer: Sequence[Keyframe], older: Sequence[Keyframe]) -> np.ndarray:
    """(N, O) m from the gel of the newer one that is farthest from all of the older one's; endless across a lift.

    The object may have been moved then.
    """
    (here, rows), (there, columns) = _gels(newer), _gels(older)
    nearest = np.minimum.reduceat(pose_distance(here[:, None], there), columns, axis=1)
    farthest = np.maximum.reduceat(nearest, rows, axis=0)
    stretches = (np.array([keyframe.stretch for keyframe in each]) for each in (newer, older))
    return np.where(np.equal.outer(*stretches), farthest, np.inf)


def _gels(keyframes: Sequence[Keyframe]) -> tuple[np.ndarray, np.ndarray]:
    """(G, 4, 4) of all gels, and the first (K,) of each keyframe's."""
    gels = [keyframe.gels for keyframe in keyframes]
    return np.concatenate(gels), np.cumsum([0, *map(len, gels[:-1])])
