"""Frames per second over the recent past."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

_SHORTEST_WINDOW_S = 1.0
_FRAMES_PER_WINDOW = 5


class RateMonitor:
    """Counts stamps within a sliding window: one second, longer for slow sources.

    Args:
        fps: expected frames per second.
        now_ns: the time of beginning, nanoseconds on the stamps' clock.
    """

    def __init__(self, fps: float, now_ns: int) -> None:
        self._window_ns = round(max(_SHORTEST_WINDOW_S, _FRAMES_PER_WINDOW / fps) * 1e9)
        self._start_ns = now_ns
        self._stamps: deque[int] = deque()

    def add(self, stamp_ns: int) -> None:
        """Counts one frame."""
        self._stamps.append(stamp_ns)
        self._forget(stamp_ns)

    @property
    def backward(self) -> int:
        """Stamps in the window that were not later than the one before."""
        return sum(later <= earlier for earlier, later in pairwise(self._stamps))

    def rate(self, now_ns: int) -> float | None:
        """Frames per second in the window that ends now; None before one whole window has passed."""
        if now_ns - self._start_ns < self._window_ns:
            return None
        self._forget(now_ns)
        return len(self._stamps) / (self._window_ns * 1e-9)

    def _forget(self, now_ns: int) -> None:
        while self._stamps and self._stamps[0] <= now_ns - self._window_ns:
            self._stamps.popleft()
