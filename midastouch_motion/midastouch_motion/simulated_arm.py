"""An arm without joints: its gel follows twists, some time later, and stops when they stop coming.

As MoveIt Servo does (`incoming_command_timeout`), and a UR after `speedL` (its argument `t`).
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from midastouch_common import se3


class SimulatedArm:
    """Args: pose (4, 4) of the gel in the base frame at first; latency [s] from a command to the motion; timeout [s]
    after which it stops without a further command. Attribute: pose (4, 4)."""

    def __init__(self, pose: np.ndarray, latency: float = 0.05, timeout: float = 0.1):
        self.pose, self._latency, self._timeout = pose.copy(), latency, timeout
        self._coming: deque[tuple[float, np.ndarray]] = deque()
        self._twist, self._until, self._now = np.zeros(6), -math.inf, -math.inf

    def command(self, now: float, twist: np.ndarray) -> None:
        """A twist (6,) in the gel's frame arrives at `now` [s]."""
        self._coming.append((now + self._latency, twist.copy()))

    def advance(self, now: float) -> np.ndarray:
        """The pose (4, 4) at `now` [s]."""
        while self._coming and self._coming[0][0] <= now:
            begins, twist = self._coming.popleft()
            self._move(begins)
            self._twist, self._until = twist, begins + self._timeout
        self._move(now)
        return self.pose

    def _move(self, now: float) -> None:
        moving = min(now, self._until) - self._now
        if moving > 0 and math.isfinite(self._now):
            self.pose = self.pose @ se3.exp(moving * self._twist)
        self._now = max(now, self._now)
