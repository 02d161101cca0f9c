from __future__ import annotations

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from midastouch_common.ros import diagnostics

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("brisk_health")]


class _Node(Node):
    def __init__(self):
        super().__init__("healthy")
        self.level = diagnostics.OK
        self.diagnostics = diagnostics.Diagnostics(self, lambda: (self.level, "fine", {"depth": 3}), hardware_id="D1")


def test_status_and_problems(graph):
    node = graph.add(_Node)
    received = graph.listen(DiagnosticArray, "/diagnostics")
    graph.spin_until(lambda: received)
    status = received[-1].status[0]
    assert (status.level, status.message, status.hardware_id) == (diagnostics.OK, "fine", "D1")
    assert {v.key: v.value for v in status.values} == {"depth": "3"}

    node.diagnostics.problem("bad_images", "an image was square")
    graph.spin_until(lambda: any(m.status[0].message == "an image was square" for m in received))
    bad = next(m for m in received if m.status[0].message == "an image was square").status[0]
    assert bad.level == diagnostics.WARN
    assert {v.key: v.value for v in bad.values}["bad_images"] == "1"

    count = len(received)
    graph.spin_until(lambda: len(received) > count)
    after = received[-1].status[0]
    assert (after.level, after.message) == (diagnostics.OK, "fine"), "a problem is reported once"
    assert {v.key: v.value for v in after.values}["bad_images"] == "1", "but stays counted"


def test_rate_restarts_when_asked():
    rate = diagnostics.Rate()
    rate.add(0.002)
    rate.add(0.004)
    assert rate.values()["mean_ms"] == "3.00"
    assert rate.values()["mean_ms"] == "0.00"
