"""A node's health on `/diagnostics` (REP 107)."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from .private_rclpy import RCLError

PERIOD_S = 1.0
_LOG_PERIOD = 5.0
LASTING_S = 2.0
"""Time [s] after which `LastingWarnings` logs a reason: what only takes its time at a start is over by then."""
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Diagnostics:
    """Publisher of a node's status, once per `PERIOD_S` unless `set_period` changes that.

    `describe` returns (level, message, values) when a status is due; the node keeps its own counters.
    An event reported through `problem` raises the next status to at least WARN and is its message.

    Attributes: hardware_id, the device that the node reports on, such as a sensor's serial number; may change any time.
    """

    def __init__(self, node: Node, describe: Callable[[], tuple[bytes, str, dict]], hardware_id: str = ""):
        self._node, self._describe, self.hardware_id = node, describe, hardware_id
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._problems: dict[str, int] = {}
        self._log_again: dict[str, float] = {}
        self._recent = ""
        # a steady clock: the status must continue while a bag is paused
        self._timer = node.create_timer(PERIOD_S, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def set_period(self, seconds: float) -> None:
        """Publish a status once in `seconds` from now on."""
        self._timer.timer_period_ns = round(seconds * 1e9)
        self._timer.reset()

    def problem(self, kind: str, message: str) -> None:
        """Count an event of bad input under `kind`, name it in the next status and log it at most once in 5 s."""
        self._problems[kind] = self._problems.get(kind, 0) + 1
        self._recent = message
        # rclpy's own throttle inspects the stack at every call, which costs a millisecond per bad frame
        now = time.monotonic()
        if now >= self._log_again.get(kind, now):
            self._log_again[kind] = now + _LOG_PERIOD
            self._node.get_logger().warning(message)

    @contextlib.contextmanager
    def kept_up(self) -> Iterator[None]:
        """Publish at once and then periodically, from another thread, while the caller blocks the executor."""
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
        """Number of problems since the start, by kind."""
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


class LastingWarnings:
    """Warnings of what keeps a node from its work: each is logged once when it has lasted, and once when it is over."""

    def __init__(self, node: Node, now: Callable[[], float] = time.monotonic) -> None:
        self._node, self._now = node, now
        self._since: dict[str, float] = {}
        self._logged: dict[str, str] = {}

    def has_logged(self, kind: str) -> bool:
        """Return whether a warning of this kind has been logged and is not over."""
        return kind in self._logged

    def observe(self, reasons: Mapping[str, str]) -> None:
        """Take note of all present reasons by their kinds, about once a second; a text may change, its kind stays."""
        now = self._now()
        self._since = {kind: self._since.get(kind, now) for kind in reasons}
        for kind, reason in reasons.items():
            if kind not in self._logged and now - self._since[kind] >= LASTING_S:
                self._logged[kind] = reason
                self._node.get_logger().warning(reason)
        for kind in self._logged.keys() - reasons.keys():
            self._node.get_logger().info(f"over: {self._logged.pop(kind)}")


class Rate:
    """Events per second, and the mean time that each one took, since the last reading."""

    def __init__(self) -> None:
        self._since, self._count, self._busy = time.monotonic(), 0, 0.0

    def add(self, seconds: float) -> None:
        """Count one event that took `seconds` of work."""
        self._count += 1
        self._busy += seconds

    def values(self) -> dict[str, str]:
        """Return `rate_hz` and `mean_ms` since the last call."""
        now = time.monotonic()
        rate = self._count / max(now - self._since, 1e-9)
        mean = 1e3 * self._busy / max(self._count, 1)
        self._since, self._count, self._busy = now, 0, 0.0
        return {"rate_hz": f"{rate:.1f}", "mean_ms": f"{mean:.2f}"}
