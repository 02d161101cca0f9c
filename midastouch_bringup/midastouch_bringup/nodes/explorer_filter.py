"""What the filter says to an explorer of the images of its arm."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_msgs.msg import FilterStatus


class FilterAnswers:
    """Attributes: state and reason, those of the newest answer, empty before the first; stamp [ns] of its image;
    measured, whether it has measured anything since that was set; heard_at [s], when it came, by a clock that never
    stops.

    Args: newest(): stamp [ns] of the gel's newest pose; on_answer: called after each answer.
    """

    def __init__(self, node: Node, newest: Callable[[], int], on_answer: Callable[[], None]):
        self._newest, self._on_answer = newest, on_answer
        self.state, self.reason, self.stamp, self.measured = "", "", 0, False
        self.heard_at = time.monotonic()
        node.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched(depth=100))

    @property
    def says(self) -> str:
        """State and reason in words."""
        return f"the filter says {self.state}: {self.reason}"

    def _on_status(self, status: FilterStatus) -> None:
        stamp = stamp_ns(status.header.stamp)
        # what the filter says on a clock of its own answers no image
        if status.state == FilterStatus.STATE_WAITING or stamp > self._newest():
            return
        self.state, self.reason, self.stamp, self.heard_at = status.state, status.reason, stamp, time.monotonic()
        # one that does not know yet which object it is says nothing of contact
        self.measured = self.measured or status.state != FilterStatus.STATE_NO_CONTACT
        self._on_answer()
