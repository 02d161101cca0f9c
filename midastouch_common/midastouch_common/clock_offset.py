"""Conversion of the kernel's monotonic clock to wall (ROS) time, by an offset that is measured continually.

Camera buffers carry ``CLOCK_MONOTONIC``; TF and all other data on the robot carry wall time. The offset between
the two is not constant: NTP slews it by up to 500 ppm and sometimes steps it. An error of 0.15 s, as seen in
drivers that measure the offset once or badly, is 4.5 mm of travel at 30 mm/s.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

PAIRS = 5
TIME_CONSTANT_NS = 2e9
"""Time constant of the low-pass. Under a slew of 500 ppm the estimate lags by 1 ms, which must be below `STEP_NS`."""
STEP_NS = 5_000_000
"""A deviation larger than this, plus the measurement's own uncertainty, counts as a step of the wall clock."""


class ClockOffset:
    """Running estimate of wall time minus monotonic time [ns].

    One measurement reads the wall clock between two readings of the monotonic clock, ``PAIRS`` times, and keeps the
    tightest pair: its error is at most half the time between its two readings. Measurements are low-passed, because a
    preempted process measures badly; a step (see ``STEP_NS``) is adopted at once.

    Parameters
    ----------
    monotonic_ns, wall_ns : the two clocks [ns]
    """

    def __init__(
        self, monotonic_ns: Callable[[], int] = time.monotonic_ns, wall_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self._monotonic_ns = monotonic_ns
        self._wall_ns = wall_ns
        self._offset_ns, _, self._updated_ns = self._measure()
        self.steps = 0
        self.last_step_ns = 0

    @property
    def offset_ns(self) -> int:
        """Wall time minus monotonic time [ns]."""
        return self._offset_ns

    def update(self) -> None:
        """Take one measurement; cheap enough (a few microseconds) for every frame."""
        measured, uncertainty, now = self._measure()
        deviation = measured - self._offset_ns
        if abs(deviation) > STEP_NS + uncertainty:
            self._offset_ns = measured
            self.steps += 1
            self.last_step_ns = deviation
        else:
            gain = 1.0 - math.exp(-max(0, now - self._updated_ns) / TIME_CONSTANT_NS)
            self._offset_ns += round(gain * deviation)
        self._updated_ns = now

    def to_wall_ns(self, monotonic_ns: int) -> int:
        """Return the wall time of a moment on the monotonic clock."""
        return monotonic_ns + self._offset_ns

    def _measure(self) -> tuple[int, int, int]:
        """Return offset, its greatest possible error, and monotonic time of the tightest of ``PAIRS`` readings [ns]."""
        readings = []
        for _ in range(PAIRS):
            before = self._monotonic_ns()
            wall = self._wall_ns()
            after = self._monotonic_ns()
            readings.append((after - before, wall - (before + after) // 2, after))
        width, offset, after = min(readings)
        return offset, (width + 1) // 2, after
