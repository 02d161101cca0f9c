from __future__ import annotations

from types import SimpleNamespace

import pytest
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
    health = graph.health()
    status = health.until("fine")
    assert (status.level, status.hardware_id) == (diagnostics.OK, "D1")
    assert health.values == {"depth": "3"}

    node.diagnostics.problem("bad_images", "an image was square")
    assert health.until("an image was square").level == diagnostics.WARN
    assert health.values["bad_images"] == "1"

    health.clear()
    after = health.until("")
    assert (after.level, after.message) == (diagnostics.OK, "fine"), "a problem is reported once"
    assert health.values["bad_images"] == "1", "but stays counted"


def test_rate_restarts_when_asked():
    rate = diagnostics.Rate()
    rate.add(0.002)
    rate.add(0.004)
    assert rate.values()["mean_ms"] == "3.00"
    assert rate.values()["mean_ms"] == "0.00"


def test_a_warning_that_lasts_is_logged_once_and_so_is_its_end():
    logged, now = [], [0.0]
    logger = SimpleNamespace(warning=lambda text: logged.append(text), info=lambda text: logged.append(text))
    warnings = diagnostics.LastingWarnings(SimpleNamespace(get_logger=lambda: logger), lambda: now[0])

    def observe(seconds, **reasons):
        now[0] = seconds
        warnings.observe(reasons)
        return [logged.pop(0) for _ in range(len(logged))]

    soon = diagnostics.LASTING_S / 2
    assert observe(0.0, tf="no TF for 0 s") == []
    assert observe(soon) == [], "it was short"
    assert observe(1 + soon, tf="no TF for 1 s") == []
    assert observe(1 + 3 * soon, tf="no TF for 2 s", image="no image") == ["no TF for 2 s"]
    assert observe(1 + 5 * soon, tf="no TF for 3 s", image="no image") == ["no image"]
    assert observe(1 + 9 * soon, tf="no TF for 5 s") == ["over: no image"]
    assert observe(90.0) == ["over: no TF for 2 s"]
