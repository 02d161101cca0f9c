"""Check whether a frame shows anything that the frames before it did not."""

from __future__ import annotations

import numpy as np

from midastouch_common.pose_metric import pose_errors

from .config import FilterConfig
from .gates import Gates
from .touch import Measurement


class Novelty:
    """Detector of frames in which all gels rest (`resting`) or the images are the last ones again; gates count both."""

    def __init__(self, config: FilterConfig, gates: Gates):
        self._config, self._gates = config, gates
        self.resting = False
        self.forget()

    def forget(self) -> None:
        """Forget the last frame: whatever is touched next is new."""
        self._seen: tuple[np.ndarray, list[Measurement]] | None = None

    def take(self, gels: np.ndarray, touches: list[Measurement]) -> None:
        """Remember a frame as seen: its gels (F, 4, 4) in a fixed frame, and their touches."""
        self._seen = gels, touches

    def is_new(self, gels: np.ndarray, touches: list[Measurement]) -> bool:
        """Return whether a frame is new, and remember it if so; arguments as for `take`. Sets `resting`."""
        self.resting = False
        if self._seen is not None and len(self._seen[1]) == len(touches) and self._same(gels, touches):
            return False
        self.take(gels, touches)
        return True

    def _same(self, gels: np.ndarray, touches: list[Measurement]) -> bool:
        at, before = self._seen
        distance, angle = pose_errors(at, gels)
        within = (distance <= self._config.update_min_d) & (angle <= self._config.update_min_a)
        self.resting = bool(within.all())
        if self._gates.skips("at_rest", self.resting):
            return True
        again = all(
            np.array_equal(a.penetration, b.penetration) and np.array_equal(a.code, b.code)
            for a, b in zip(before, touches, strict=True)
        )
        return self._gates.skips("unchanged_code", again)
