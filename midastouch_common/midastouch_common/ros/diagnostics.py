"""A node's health on `/diagnostics` (REP 107)."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

RCLError = rclpy_implementation.RCLError
"""What calls of rclpy raise, as when a signal has stopped it meanwhile."""
PERIOD_S = 1.0
_LOG_PERIOD = 5.0
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Diagnostics:
    """Publishes one status per `PERIOD_S`, unless `set_period` says another.

    `describe` returns (level, message, values) when a status is due; counters are kept by the node itself.
    Events reported through `problem` raise the next status to WARN and are named in it.

    Attributes: hardware_id, what the node reports on, such as the serial number of a sensor; may be set at any time.
    """

    def __init__(
        self,
        node: Node,
        describe: Callable[[], tuple[bytes, str, dict]],
        hardware_id: str = "",
    ):
        self._node, self._describe, self.hardware_id = node, describe, hardware_id
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._problems: dict[str, int] = {}
        self._log_again: dict[str, float] = {}
        self._recent = ""
        # steady: a bag that is paused must not silence a node's health
        self._timer = node.create_timer(PERIOD_S, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def set_period(self, seconds: float) -> None:
        """Publish a status once in so many seconds from now on."""
        self._timer.timer_period_ns = round(seconds * 1e9)
        self._timer.reset()

    def problem(self, kind: str, message: str) -> None:
        """Count an event of bad input under `kind`, name it in the next status and log it at most once in 5 s."""
        self._problems[kind] = self._problems.get(kind, 0) + 1
        self._recent = message
        # rclpy's own throttle inspects the stack at every call, a millisecond a bad frame
        now = time.monotonic()
        if now >= self._log_again.get(kind, now):
            self._log_again[kind] = now + _LOG_PERIOD
            self._node.get_logger().warning(message)

    @contextlib.contextmanager
    def kept_up(self) -> Iterator[None]:
        """Publish from a thread, at once and then periodically, while the caller blocks the executor."""
        over = threading.Event()

        def publish() -> None:
            while not over.is_set() and self._node.context.ok():
                try:
                    self.publish()
                except RCLError:  # a signal stopped the process in the middle of the call
                    if self._node.context.ok():
                        raise
                over.wait(PERIOD_S)

        thread = threading.Thread(target=publish, name="diagnostics", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    @property
    def counts(self) -> dict[str, int]:
        """Problems since the start by kind."""
        return dict(self._problems)

    def publish(self) -> None:
        """Publish the status now."""
        level, message, values = self._describe()
        if self._recent:
            level, message = max(level, WARN), self._recent
            self._recent = ""
        status = DiagnosticStatus(
            level=level,
            name=f"{self._node.get_name()}: {self._node.get_fully_qualified_name()}",
            message=message,
            hardware_id=self.hardware_id,
            values=[KeyValue(key=str(k), value=str(v)) for k, v in {**values, **self._problems}.items()],
        )
        out = DiagnosticArray(status=[status])
        out.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(out)


class Rate:
    """Events per second over the time since they were last read, and the mean time each one took."""

    def __init__(self) -> None:
        self._since, self._count, self._busy = time.monotonic(), 0, 0.0

    def add(self, seconds: float) -> None:
        """One event that took `seconds` of work."""
        self._count += 1
        self._busy += seconds

    def values(self) -> dict[str, str]:
        """`rate_hz` and `mean_ms` since the last call."""
        now = time.monotonic()
        rate = self._count / max(now - self._since, 1e-9)
        mean = 1e3 * self._busy / max(self._count, 1)
        self._since, self._count, self._busy = now, 0, 0.0
        return {"rate_hz": f"{rate:.1f}", "mean_ms": f"{mean:.2f}"}
