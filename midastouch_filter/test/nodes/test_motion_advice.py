"""Service and action `suggest_motion` of the node."""

from __future__ import annotations

import math

import pytest
from action_msgs.msg import GoalStatus
from filter_bench import OBJECT, T_BASE_OBJ, Bench
from filter_fakes import all_finite
from goals import Asked
from tf_messages import translation
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_msgs import action
from midastouch_msgs.srv import SuggestMotion

pytestmark = pytest.mark.dds


def ask(graph, **wanted) -> SuggestMotion.Response:
    return graph.call(SuggestMotion, "suggest_motion", SuggestMotion.Request(**wanted))


def touched(graph, **parameters) -> Bench:
    """The node once it has measured something."""
    bench = Bench(graph, **OBJECT, **parameters)
    bench.frame(SECOND, T_BASE_OBJ)
    return bench


def follow(graph, **wanted) -> Asked:
    """A goal of the action, once it is accepted."""
    asked = Asked(graph.companion, graph.spin_until, action.SuggestMotion, **wanted)
    graph.spin_until(lambda: asked.handle, "the goal's acceptance")
    return asked


def test_suggestions_come_as_they_were_made(graph):
    bench = touched(graph)
    shown = graph.listen(MarkerArray, "suggestions")
    answer = ask(graph, max_length=0.1, lifts=True, count=2)
    assert (answer.success, answer.message, answer.indistinguishable) == (True, "two hypotheses compete", False)
    wanted = bench.filter.wanted[-1]
    assert (wanted.max_length, wanted.lifts, wanted.count) == (0.1, True, 2)
    slide, lift = answer.suggestions
    assert (slide.heading, slide.length, slide.lift, slide.information, slide.cost) == (0.5, 0.02, False, 0.6, 0.02)
    assert [pose.position.x for pose in slide.path] == [0.0, 0.01, 0.02]
    assert lift.lift
    assert len(lift.path) == 2
    graph.spin_until(lambda: shown, "the arrows")
    assert all_finite(shown[0])
    assert {marker.text for marker in shown[0].markers} == {"", slide.reason, lift.reason}
    assert [m.action for m in shown[0].markers[:2]] == [Marker.DELETEALL] * 2


def test_who_asks_too_early_hears_why(graph):
    Bench(graph)
    refused = ask(graph)
    assert not refused.success
    assert "set_object" in refused.message
    assert follow(graph).outcome()[0] == GoalStatus.STATUS_ABORTED


def test_convergence_is_reported_however_slow_the_answers(graph):
    bench = touched(graph, suggestion_rate=0.001)
    follower = follow(graph)
    bench.filter.state = "converged"
    bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.02))
    assert follower.outcome()[0] == GoalStatus.STATUS_SUCCEEDED


def test_before_a_touch_there_is_no_advice(graph):
    bench = Bench(graph, **OBJECT)
    assert "nothing was measured" in ask(graph).message
    bench.filter.state = "no_contact"
    bench.frame(SECOND, T_BASE_OBJ)
    refused = ask(graph)
    assert not refused.success
    assert "touches nothing" in refused.message
    status, result = follow(graph).outcome()
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "touches nothing" in result.message


def test_the_papers_filter_gives_no_advice(graph):
    touched(graph, preset="paper")
    refused = ask(graph)
    assert (refused.success, refused.message) == (
        False,
        "the paper's filter cannot suggest where to touch next: set preset to balanced or fast",
    )
    assert follow(graph).outcome()[0] == GoalStatus.STATUS_ABORTED


def test_a_length_that_nobody_can_mean_is_refused(graph):
    bench = touched(graph)
    for length in (-0.1, 3.0, math.nan, math.inf):
        refused = ask(graph, max_length=length)
        assert not refused.success
        assert "max_length" in refused.message
    assert not bench.filter.wanted
    assert ask(graph).success
    assert (bench.filter.wanted[-1].max_length, bench.filter.wanted[-1].count) == (None, 3)


def test_the_action_follows_the_belief_until_it_has_converged(graph):
    bench = touched(graph, suggestion_rate=0.0)
    follower = follow(graph, count=1)
    graph.spin_until(lambda: follower.feedback, "what is suggested at once")
    bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.01))
    graph.spin_until(lambda: stamp_ns(follower.feedback[-1].header.stamp) == 2 * SECOND, "what follows from the touch")
    assert follower.feedback[-1].header.frame_id == "object"
    assert [each.length for each in follower.feedback[-1].suggestions] == [0.02]
    assert follower.result is None
    bench.filter.state = "converged"
    bench.frame(3 * SECOND, T_BASE_OBJ @ translation(0.02))
    status, result = follower.outcome()
    assert (status, result.success, result.indistinguishable) == (GoalStatus.STATUS_SUCCEEDED, True, False)


def test_the_action_ends_where_nothing_can_be_distinguished(graph):
    bench = touched(graph, suggestion_rate=0.0)
    follower = follow(graph)
    bench.filter.alike = True
    bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.01))
    status, result = follower.outcome()
    assert (status, result.success, result.indistinguishable) == (GoalStatus.STATUS_SUCCEEDED, True, True)


def test_a_lift_on_the_way_does_not_end_the_action(graph):
    bench = touched(graph, suggestion_rate=0.0)
    follower = follow(graph)
    bench.filter.state = "no_contact"
    bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.01))
    bench.filter.state = "ambiguous"
    bench.frame(3 * SECOND, T_BASE_OBJ @ translation(0.02))
    graph.spin_until(lambda: stamp_ns(follower.feedback[-1].header.stamp) == 3 * SECOND, "the next suggestion")
    assert follower.result is None


def test_the_action_can_be_cancelled(graph):
    touched(graph)
    follower = follow(graph)
    cancelled = follower.handle.cancel_goal_async()
    graph.spin_until(cancelled.done, "the answer to the cancellation")
    assert follower.outcome()[0] == GoalStatus.STATUS_CANCELED


def test_a_node_that_is_deactivated_ends_the_action(graph):
    touched(graph)
    follower = follow(graph)
    assert graph.change_state("particle_filter", "deactivate")
    status, result = follower.outcome()
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "ros2 lifecycle set" in ask(graph).message


def test_who_asks_the_same_at_the_same_frame_costs_nothing(graph):
    bench = touched(graph, suggestion_rate=0.0)
    followers = [follow(graph, count=2) for _ in range(3)]
    assert ask(graph, count=2).success
    bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.01))
    graph.spin_until(lambda: all(len(each.feedback) == 2 for each in followers), "what follows from both touches")
    assert len(bench.filter.wanted) == 2, "one answer a frame"
    assert ask(graph, count=1).success
    assert len(bench.filter.wanted) == 3, "another question is another answer"
