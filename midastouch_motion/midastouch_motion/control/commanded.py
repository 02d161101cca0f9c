"""Twists that an arm was sent, and the way that it has gone by them."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

_KEPT = 1024  # twists; some seconds


class Commanded:
    """Twists so far, each of which acts until the next. Attributes: latency [s] from a twist to the motion; last (6,),
    the newest twist, and now [s], when it was sent, -inf before the first."""

    def __init__(self, latency: float):
        self.latency, self.last, self.now = latency, np.zeros(6), -math.inf
        self._twists: deque[tuple[float, float, np.ndarray]] = deque(maxlen=_KEPT)  # from, to, twist

    def keep(self, now: float, twist: np.ndarray) -> np.ndarray:
        """Take a twist (6,) that is sent now [s], and return it."""
        if self._twists:
            begin, _, last = self._twists[-1]
            self._twists[-1] = begin, now, last
        self._twists.append((now, math.inf, twist))
        self.last, self.now = twist, now
        return twist

    def way(self, since: float, until: float) -> np.ndarray:
        """Return the way and turn (6,) of the arm between two moments [s], by the twists so far."""
        since, until = since - self.latency, min(until - self.latency, self.now)
        total = np.zeros(6)
        for begin, end, twist in reversed(self._twists):
            if end <= since:
                break
            total += max(min(end, until) - max(begin, since), 0.0) * twist
        return total
