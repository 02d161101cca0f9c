"""The last touches, kept at a distance from each other along the path: a window of keyframes."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .touch import Measurement

_LIFTED = 0.01  # m of path without contact; less is a gap in a slide
_ENDLESS = 10**9  # touches since the last lift, while there was none


@dataclass(frozen=True)
class Keyframe:
    """What fingers felt in one frame.

    motion (4, 4): of the first gel, from the start to this frame; touches of those in contact; log_ratios, for each
    (M,) of every codebook entry as that finger's pose; shortlists, for each (S,) the entries with the best of them.
    """

    motion: np.ndarray
    touches: list[Measurement]
    log_ratios: list[np.ndarray]
    shortlists: list[np.ndarray]

    def maps(self, settled: bool) -> list[Measurement]:
        """Touches to align to: as long as the place is not settled, the first one's only."""
        found = [touch for touch in self.touches if touch.penetration is not None]
        return found if settled else found[:1]


class KeyframeWindow:
    """Keeps the newest `length` keyframes, `spacing` [m] of path apart, each with a shortlist of so many entries.

    Attributes: motion (4, 4), of the first gel since the start; keyframes, oldest first.
    """

    def __init__(self, length: int, spacing: float, shortlist: int):
        self._length, self._spacing, self._shortlist = length, spacing, shortlist
        self.restart()

    def restart(self) -> None:
        """Forget all."""
        self.motion = np.eye(4)
        self.keyframes: deque[Keyframe] = deque(maxlen=self._length)
        self._path = np.inf
        self._in_the_air, self._since_lift = 0.0, _ENDLESS

    def __len__(self) -> int:
        return len(self.keyframes)

    def moved(self, transform: np.ndarray, path: float, in_contact: bool) -> None:
        """The first gel moved by `transform` (4, 4), which counts as `path` [m]."""
        self.motion = self.motion @ transform
        self._path += path
        self._in_the_air = 0.0 if in_contact else self._in_the_air + path
        if self._in_the_air > _LIFTED:
            self._since_lift = 0

    @property
    def due(self) -> bool:
        """Whether the present touch is worth keeping."""
        return self._path >= self._spacing

    def keep(self, touches: list[Measurement], log_ratios: Sequence[np.ndarray]) -> None:
        """Keep what fingers feel at present, the first one first."""
        rounded, count = [each.astype(np.float16) for each in log_ratios], self._shortlist // len(touches)
        best = [np.argpartition(-each, min(count, len(each) - 1))[:count] for each in rounded]
        self.keyframes.append(Keyframe(self.motion, touches, rounded, best))
        self._path = 0.0
        self._since_lift += 1

    def forget_before_lift(self) -> bool:
        """Forget the keyframes from before the sensor was lifted; whether it was lifted since the oldest."""
        if self._since_lift >= len(self.keyframes):
            return False
        kept, motion = list(self.keyframes)[len(self.keyframes) - self._since_lift :], self.motion
        self.restart()
        self.motion = motion
        self.keyframes.extend(kept)
        return True
