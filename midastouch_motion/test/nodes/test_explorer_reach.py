"""Somebody who knows the arm is asked what it reaches."""

import pytest
from explorer_rig import Rig
from rclpy.node import Node

from midastouch_common.errors import InputError
from midastouch_common.frames import BASE_FRAME
from midastouch_motion.nodes import explorer_services
from midastouch_motion.nodes.explorer import Explorer
from midastouch_msgs.srv import CheckReach

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("hasty")]


def offer(graph, answers=lambda poses: [True] * poses, message=""):
    """Offer the service, which by default reaches everything; the requests that come."""
    asked = []

    def on_request(request, response):
        asked.append(request)
        response.reachable, response.message = answers(len(request.poses.poses)), message
        return response

    service = graph.companion.create_service(CheckReach, "what_it_reaches", on_request)
    return asked, service


def test_it_is_asked_before_each_motion(graph):
    asked, _ = offer(graph)
    rig = Rig(graph, reach_service="what_it_reaches")
    rig.until("exploring", "somewhere")
    rig.state = "converged"
    status = rig.until("known")
    assert status.slides >= 1
    assert len(asked) >= status.slides
    assert {request.poses.header.frame_id for request in asked} == {BASE_FRAME}


@pytest.mark.parametrize(
    ("answers", "message", "why"),
    [
        (lambda poses: [False] * poses, "joint 3", "the arm does not reach it: joint 3"),
        (lambda _: [True], "", "reach_service what_it_reaches: 1 answers for"),
    ],
    ids=["nothing", "too few"],
)
def test_without_a_yes_nothing_moves_and_the_reason_is_said(graph, answers, message, why):
    offer(graph, answers, message)
    rig = Rig(graph, reach_service="what_it_reaches")
    status = rig.until("gave_up", "the finger is stuck")
    assert why in status.reason
    assert (status.slides, status.lifts) == (0, 1), "the first touch, which is straight below"
    assert rig.node.gave_up


def test_one_that_does_not_answer_is_given_up(graph, monkeypatch):
    monkeypatch.setattr(explorer_services, "TIMEOUT_S", 0.0)
    mute = Node("mute")  # which nobody spins
    mute.create_service(CheckReach, "what_it_reaches", lambda _, response: response)
    rig = Rig(graph, reach_service="what_it_reaches")
    assert "reach_service what_it_reaches: no answer for 0 s" in rig.until("gave_up", "stuck").reason
    mute.destroy_node()


def test_one_that_goes_is_missed(graph):
    asked, service = offer(graph)
    rig = Rig(graph, reach_service="what_it_reaches")
    graph.spin_until(lambda: asked, "a question")
    graph.companion.destroy_service(service)
    assert "reach_service what_it_reaches: no node offers it" in rig.until("gave_up").reason


def test_one_that_is_not_there_is_awaited_and_then_named(graph, patience_clock):
    rig = Rig(graph, give_up_after=1.0, reach_service="what_it_reaches")
    last = rig.loses_patience(patience_clock, 0.05)
    assert {status.state for status in rig.statuses} == {"waiting", "gave_up"}
    assert "reach_service what_it_reaches: no node offers it" in last.reason


def test_what_is_no_name_of_a_service_is_refused(graph):
    with pytest.raises(InputError, match=r"parameter reach_service: .*what is it"):
        graph.add(Explorer, {"reach_service": "what is it"})
