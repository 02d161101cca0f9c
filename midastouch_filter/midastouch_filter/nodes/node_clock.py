"""The clocks of the filter node."""

from __future__ import annotations

from rclpy.clock import Clock, ClockType
from rclpy.node import Node


class NodeClock:
    """Attributes: steady, rclpy's clock that never stops and that NTP cannot step."""

    def __init__(self, node: Node):
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._node = node
        # paused simulated time must not run out the time-outs
        self._patience = node.get_clock() if node.get_parameter("use_sim_time").value else self.steady
        self._last = self._gone = 0.0

    def now(self) -> float:
        """Seconds by which time-outs run; simulated time that jumps back does not turn them back."""
        last, self._last = self._last, 1e-9 * self._patience.now().nanoseconds
        self._gone += max(0.0, last - self._last)
        return self._last + self._gone

    def steady_now(self) -> float:
        """Seconds that pass in any case."""
        return 1e-9 * self.steady.now().nanoseconds

    def stamp(self) -> int:
        """Stamp [ns] of what is said of no image."""
        # a replay's clock stands at the stamp of the image that it waits for, whose answer this is not
        return max(0, self._node.get_clock().now().nanoseconds - 1)
