"""Codes in time: transforms that come late or never; stamps that repeat, are late or run backwards."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from filter_bench import OBJECT, T_BASE_OBJ, Bench, skipped
from filter_fakes import code_msg
from rosgraph_msgs.msg import Clock
from tf_messages import tf_msg, translation

from midastouch_common.message_arrays import SECOND, stamp_ns

pytestmark = pytest.mark.dds


def test_codes_wait_for_their_transform_in_order(graph):
    bench = Bench(graph, **OBJECT)
    for stamp in (1, 2, 3):
        bench.codes.publish(code_msg(stamp * SECOND))
    graph.spin_until(lambda: bench.waited(3 * SECOND), "the word that it waits")
    assert "no transform yet: frame 'base_link'" in bench.waits[-1].reason
    assert bench.statuses == []
    for stamp in (1, 2, 3):
        bench.tf.publish(tf_msg(stamp * SECOND, translation(0.01 * stamp)))
    graph.spin_until(lambda: len(bench.statuses) == 3)
    assert bench.answered() == [SECOND, 2 * SECOND, 3 * SECOND]
    np.testing.assert_allclose(bench.filter.odometry[2], translation(0.01), atol=1e-9)
    told = [stamp_ns(status.header.stamp) for status in bench.waits]
    assert len(set(told)) == len(told), "each is told once"


def test_transform_that_never_comes_is_stale_with_a_reason(graph, timeout_clock):
    bench = Bench(graph, **OBJECT, transform_timeout=0.2)
    bench.delay(SECOND)
    timeout_clock.now += 0.3  # and no more: the transform of the next frame may be read late
    graph.spin_until(lambda: bench.statuses)
    assert bench.answered() == [SECOND]
    assert bench.statuses[0].state == "stale"
    assert "digit_gel_frame" in bench.statuses[0].reason
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous", "it recovers"


def simulated_clock(bench: Bench) -> Callable[[float], None]:
    """A function that sets the node's clock [s]."""
    clock = bench.graph.publisher(Clock, "/clock")

    def tick(seconds: float) -> None:
        now = round(seconds * SECOND)
        clock.publish(Clock(clock=code_msg(now).header.stamp))
        bench.graph.spin_until(lambda: bench.node.get_clock().now().nanoseconds == now)

    return tick


def test_paused_simulated_time_does_not_run_out(graph):
    bench = Bench(graph, **OBJECT, use_sim_time=True, transform_timeout=0.2)
    tick = simulated_clock(bench)

    tick(10.0)
    bench.delay(10 * SECOND)
    graph.spin_for(0.3)
    assert bench.statuses == []
    tick(10.5)
    graph.spin_until(lambda: bench.statuses)
    assert bench.statuses[0].state == "stale"


def test_simulated_time_jumping_back_does_not_stretch_a_timeout(graph):
    bench = Bench(graph, **OBJECT, use_sim_time=True, transform_timeout=0.2)
    tick = simulated_clock(bench)

    tick(1e6)
    bench.delay(10 * SECOND)
    tenths = itertools.count(100)

    def goes_on() -> bool:
        tick(0.1 * next(tenths))
        return bool(bench.statuses)

    graph.spin_until(goes_on, "the answer")
    assert bench.statuses[0].state == "stale"


def test_looped_bag_restarts_once_per_loop(graph):
    bench = Bench(graph, **OBJECT)
    for loop in (1, 2, 3):
        for stamp in (100, 101, 102):
            assert bench.frame(stamp * SECOND, translation(0.01 * stamp)).state == "ambiguous"
        assert bench.filter.starts == ["uniform"] * loop
        assert bench.filter.odometry[-3] is None
    status = bench.statuses[-1]
    assert skipped(status)["time_jumps"] == 2


def test_looped_bag_whose_code_overtakes_its_transform(graph):
    bench = Bench(graph, **OBJECT)
    bench.frame(100 * SECOND, translation(1.0))
    bench.delay(10 * SECOND)
    assert bench.filter.starts == ["uniform"]
    bench.tf.publish(tf_msg(10 * SECOND, translation(0.1)))
    graph.spin_until(lambda: bench.answered()[-1] == 10 * SECOND)
    assert bench.statuses[-1].state == "ambiguous"
    assert bench.filter.starts == ["uniform"] * 2


@pytest.mark.parametrize("wrong", [0, 5000])
def test_a_single_wrong_stamp_is_dropped_and_said(graph, wrong):
    """Of a driver that loses its clock for one image."""
    bench = Bench(graph, **OBJECT)
    bench.frame(100 * SECOND, translation(0.0))
    bench.delay(wrong * SECOND)
    for stamp in (101, 102):
        assert bench.frame(stamp * SECOND, translation(0.01)).state == "ambiguous"
    assert bench.filter.starts == ["uniform"]
    np.testing.assert_allclose(bench.filter.odometry[1], translation(0.01), atol=1e-9)
    (refused,) = bench.answers(wrong * SECOND)
    assert refused.state == "stale"
    assert "dropped" in refused.reason
    assert skipped(bench.statuses[-1])["odd_stamps"] == bench.node.diagnostics.counts["odd_stamps"] == 1
    assert skipped(bench.statuses[-1])["time_jumps"] == 0


def test_a_lone_wrong_stamp_is_answered_in_the_end(graph, timeout_clock):
    bench = Bench(graph, **OBJECT, transform_timeout=0.5)
    bench.frame(100 * SECOND)
    bench.delay(0)
    timeout_clock.now += 0.6
    graph.spin_until(lambda: bench.answers(0), "the answer")
    assert bench.statuses[-1].state == "stale"
    assert bench.filter.starts == ["uniform"]


def test_repeated_and_late_stamps_are_answered_but_not_counted(graph):
    bench = Bench(graph, **OBJECT)
    bench.frame(10 * SECOND, T_BASE_OBJ)
    for stamp in (10 * SECOND, 10 * SECOND - 100_000_000):
        bench.codes.publish(code_msg(stamp))
    graph.spin_until(lambda: len(bench.statuses) == 3)
    assert len(bench.filter.measurements) == 1
    assert [status.state for status in bench.statuses] == ["ambiguous", "stale", "stale"]
    assert "out of order" in bench.statuses[-1].reason
    assert bench.answered()[1:] == [10 * SECOND, 10 * SECOND - 100_000_000]
    status = bench.statuses[-1]
    assert skipped(status)["out_of_order"] == 2
