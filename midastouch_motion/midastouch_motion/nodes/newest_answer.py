"""The filter's newest answer to an image of the gel where it is."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_msgs.msg import FilterStatus


class NewestAnswer:
    """Attributes: state, reason: of the newest answer, empty before the first; unknown: probability of another object;
    stamp [ns]: of its image; measured: True if the filter has measured anything since it was set to False; heard_at
    [s]: time of the answer on the monotonic clock.

    Args: newest(): stamp [ns] of the gel's newest pose; on_answer: called after each answer.
    """

    def __init__(self, node: Node, newest: Callable[[], int], on_answer: Callable[[], None]):
        self._newest, self._on_answer = newest, on_answer
        self.state, self.reason, self.stamp, self.measured = "", "", 0, False
        self.unknown, self.heard_at = 0.0, time.monotonic()
        node.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched(depth=100))

    @property
    def says(self) -> str:
        """State and reason in words."""
        return f"the filter is {self.state}: {self.reason}"

    @property
    def judged(self) -> tuple[str, str, bool, float]:
        """State, reason, measured and unknown, as `Exploration.judge` takes them."""
        return self.state, self.reason, self.measured, self.unknown

    def _on_status(self, status: FilterStatus) -> None:
        stamp = stamp_ns(status.header.stamp)
        # a status that the filter stamps by its own clock answers no image
        if status.state == FilterStatus.STATE_WAITING or stamp > self._newest():
            return
        self.state, self.reason, self.stamp, self.heard_at = status.state, status.reason, stamp, time.monotonic()
        self.unknown = status.unknown
        # a filter that does not know the object yet does not report contact, which counts as measured
        self.measured = self.measured or status.state != FilterStatus.STATE_NO_CONTACT
        self._on_answer()
