"""Messages on the pipes to and from the program `ur_follower`: a line for each order and each report."""

from __future__ import annotations

import os
import select
from dataclasses import dataclass

import numpy as np

READY, ALIVE, TROUBLE = "ready", "alive", "trouble"
"""First words of reports: the arm is connected, the program is alive, it ends for the reason that follows."""


@dataclass(frozen=True)
class Order:
    """A twist (6,) of the TCP along its own axes [m/s, rad/s], and when it was sent [s, monotonic clock]."""

    sent: float
    twist: np.ndarray

    def line(self) -> bytes:
        """Return the order as a line."""
        return (" ".join(map(repr, [self.sent, *self.twist.tolist()])) + "\n").encode()

    @classmethod
    def of_line(cls, line: bytes) -> Order:
        """Return the order that a line holds."""
        sent, *twist = map(float, line.split())
        return cls(sent, np.array(twist))


class Orders:
    """Reading end of the pipe of orders; descriptor: its file descriptor."""

    def __init__(self, descriptor: int):
        self._descriptor, self._data = descriptor, b""
        self._newest: Order | None = None

    def wait(self, seconds: float) -> Order | None:
        """Wait at most `seconds` for a further order, and return the newest; raises EOFError after the last one."""
        if select.select([self._descriptor], [], [], seconds)[0]:
            data = os.read(self._descriptor, 65536)
            if not data:
                raise EOFError
            *lines, self._data = (self._data + data).split(b"\n")
            if lines:
                self._newest = Order.of_line(lines[-1])
        return self._newest
