"""An arm that follows twists, for tests of control."""

from __future__ import annotations

import math

import numpy as np

from midastouch_common import se3
from midastouch_simulation.rehearsal import Late


class SimulatedArm:
    """An arm without joints: its gel follows twists, some time later, and stops when they stop coming. So does MoveIt
    Servo (`incoming_command_timeout`), and a UR after `speedL` (its argument `t`).

    Args: pose (4, 4) of the gel in the base frame at first; latency [s] from a command to the motion; timeout [s]
    after which it stops without a further command. Attribute: pose (4, 4).
    """

    def __init__(self, pose: np.ndarray, latency: float = 0.05, timeout: float = 0.1):
        self.pose, self._latency, self._timeout = pose.copy(), latency, timeout
        self._twists: Late[np.ndarray] = Late()
        self._twist, self._until, self._now = np.zeros(6), -math.inf, -math.inf

    def command(self, now: float, twist: np.ndarray) -> None:
        """Take a twist (6,) in the gel's frame that arrives at `now` [s]."""
        self._twists.send(now + self._latency, twist.copy())

    def advance(self, now: float) -> np.ndarray:
        """Simulate until `now` [s] and return the pose (4, 4)."""
        for begins, twist in self._twists.arrived(now):
            self._move(begins)
            self._twist, self._until = twist, begins + self._timeout
        self._move(now)
        return self.pose

    def _move(self, now: float) -> None:
        moving = min(now, self._until) - self._now
        if moving > 0 and math.isfinite(self._now):
            self.pose = self.pose @ se3.exp(moving * self._twist)
        self._now = max(now, self._now)
