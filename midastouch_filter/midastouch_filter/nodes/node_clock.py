"""Clocks of a filter node: by which time-outs run, and which stamps what is about no image."""

from __future__ import annotations

from rclpy.clock import Clock, ClockType
from rclpy.node import Node


class NodeClock:
    """Clocks of a node. Attributes: steady, rclpy's clock that never stops and that NTP cannot step."""

    def __init__(self, node: Node):
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._node = node
        # time-outs must not run out while simulated time is paused
        self._timeout_clock = node.get_clock() if node.get_parameter("use_sim_time").value else self.steady
        self._last = self._gone = 0.0

    def now(self) -> float:
        """Return the seconds by which time-outs run; simulated time that jumps back does not turn them back."""
        last, self._last = self._last, 1e-9 * self._timeout_clock.now().nanoseconds
        self._gone += max(0.0, last - self._last)
        return self._last + self._gone

    def steady_now(self) -> float:
        """Return the seconds of the steady clock."""
        return 1e-9 * self.steady.now().nanoseconds

    def stamp(self) -> int:
        """Return the stamp [ns] for a status that is about no image."""
        # 1 ns less: a replay's clock stands at the stamp of the image whose answer it waits for, which this is not
        return max(0, self._node.get_clock().now().nanoseconds - 1)
