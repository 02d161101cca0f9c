"""A person beside the explorer: starts it paused, takes the finger, pushes the object, gives the finger back."""

import numpy as np
import pytest
from explorer_rig import TOUCHING, Rig
from rclpy.node import Node

from midastouch_common.ros import qos
from midastouch_motion.nodes import explorer_services
from midastouch_msgs.msg import Suggestion
from midastouch_msgs.srv import SuggestMotion
from midastouch_simulation.finger import SimulatedFinger

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("hasty")]


def test_started_paused_it_does_not_move_before_it_is_resumed(graph):
    rig = Rig(graph, start_paused=True)
    rig.until("paused", "~/resume")
    rig.more_images(1)
    assert np.ptp([pose[:3, 3] for pose in rig.poses], axis=0).max() == 0
    assert rig.call("resume").success
    rig.until("exploring", "somewhere")


def test_what_is_resumed_while_it_waits_begins_by_itself(graph):
    rig = Rig(graph, start_paused=True)
    rig.silent = True
    rig.until("waiting")
    assert rig.call("resume").success
    assert {status.state for status in rig.statuses} == {"waiting"}
    rig.silent = False
    rig.until("exploring", "somewhere")
    assert "paused" not in {status.state for status in rig.statuses}


def test_started_paused_it_touches_before_it_obeys(graph):
    rig = Rig(graph, start_paused=True)
    rig.until("paused", "~/resume")
    assert rig.call("push").success
    rig.graph.spin_until(lambda: len({one[:3, 3].tobytes() for one in rig.objects}) > 1, "a pushed object")
    assert any(np.linalg.norm(pose[:3, 3]) < TOUCHING for pose in rig.poses)
    assert rig.statuses[-1].state == "paused"


def test_a_motion_is_judged_once_though_a_person_intervened(rig, monkeypatch):
    mute = Node("mute")  # which nobody spins
    mute.create_service(SuggestMotion, "suggest_motion", lambda _, response: response)
    rig.state = "converged"
    rig.until("exploring")
    rig.graph.spin_until(lambda: rig.statuses[-1].lifts == 1, "the first touch")
    assert rig.call("pause").success
    monkeypatch.setattr(explorer_services, "TIMEOUT_S", 0.0)
    rig.more_images(3)
    assert rig.call("resume").success
    status = rig.until("known")
    assert status.slides + status.lifts > 1
    mute.destroy_node()


def test_an_overdue_answer_moves_no_finger_that_a_person_has(rig, monkeypatch):
    def break_down(request, response):
        raise LookupError

    rig.graph.companion.create_service(SuggestMotion, "suggest_motion", break_down)
    with pytest.raises(LookupError):
        rig.graph.spin_until(lambda: False, "a question")
    assert rig.call("pause").success
    seen = len(rig.poses)
    monkeypatch.setattr(explorer_services, "TIMEOUT_S", 0.0)
    rig.more_images(3)
    assert np.ptp([pose[:3, 3] for pose in rig.poses[seen:]], axis=0).max() == 0
    assert rig.statuses[-1].reason.startswith("a person has the finger")
    with pytest.raises(LookupError):
        rig.graph.spin_until(lambda: not rig.call("resume").success, "another question")


def test_a_person_takes_the_finger_pushes_and_gives_it_back(rig):
    assert not rig.call("push").success  # nobody has touched anything
    rig.until("exploring", "somewhere")
    assert rig.call("push").success
    before = rig.objects[0]
    moved = lambda: np.linalg.norm(rig.objects[-1][:3, :3] - before[:3, :3])  # noqa: E731
    rig.graph.spin_until(lambda: moved() > 0.05, "the object to move")
    rig.until("paused", "pushed")
    orders = rig.graph.publisher(Suggestion, "explorer/move", qos.COMMAND)
    slides = rig.statuses[-1].slides
    orders.publish(Suggestion(heading=np.nan, length=0.02))
    orders.publish(Suggestion(heading=0.3, length=0.02))
    rig.graph.spin_until(lambda: rig.statuses[-1].slides > slides, "the person's slide")
    rig.state = "converged"
    rig.graph.spin_for(0.2)
    assert not rig.ended  # a person has it
    assert rig.call("resume").success
    rig.until("known")
    assert not rig.call("lift").success


def test_a_person_hears_that_a_slide_ended_early(rig, monkeypatch):
    def stuck(self, *_):
        yield from ()
        return False

    rig.until("exploring", "somewhere")
    rig.graph.spin_until(lambda: rig.statuses[-1].lifts == 1, "the first touch")
    assert rig.call("pause").success
    monkeypatch.setattr(SimulatedFinger, "slide", stuck)
    rig.graph.publisher(Suggestion, "explorer/move", qos.COMMAND).publish(Suggestion(heading=0.0, length=0.01))
    rig.until("paused", "it could not move on after 0 mm")
