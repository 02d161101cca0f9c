"""Another object, put there by a person: the simulator has to take it, and the filter."""

import time

import pytest
from explorer_rig import TOOL

from midastouch_motion.nodes import explorer_services
from midastouch_msgs.srv import SetObject
from midastouch_simulation.nodes import simulated_finger

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("hasty")]


def offer(rig, name, message=""):
    taken = []

    def on_request(request, response):
        taken.append(request.mesh_path)
        response.success, response.message = not message, message
        return response

    rig.graph.companion.create_service(SetObject, name, on_request)
    return taken


def ask(rig, path):
    return rig.graph.call(SetObject, "explorer/set_object", SetObject.Request(mesh_path=path))


def test_both_get_it_and_it_is_explored(rig):
    taken = [offer(rig, name) for name in ("digit_sim/set_object", "set_object")]
    rig.until("exploring", "somewhere")
    assert ask(rig, TOOL).success
    status = rig.until("exploring", "another object: handle_tool")
    assert taken == [[TOOL], [TOOL]]
    assert status.path_length == 0


def test_a_refused_object_leaves_the_finger_to_the_person(rig):
    offer(rig, "digit_sim/set_object")
    offer(rig, "set_object", "no codebook fits")
    rig.until("exploring", "somewhere")
    assert ask(rig, TOOL).success
    rig.until("paused", "not changed: set_object: no codebook fits")


def test_an_unanswered_object_leaves_the_finger_to_the_person(rig, monkeypatch):
    monkeypatch.setattr(explorer_services, "OBJECT_TIMEOUT_S", 0.0)
    # the finger does answer, but not before the explorer, which looks every 33 ms, has given it up
    load_mesh = simulated_finger.load_mesh
    monkeypatch.setattr(simulated_finger, "load_mesh", lambda path: time.sleep(0.1) or load_mesh(path))
    rig.until("exploring", "somewhere")
    assert ask(rig, TOOL).success
    rig.until("paused", "not changed: simulated_finger/set_object: no answer for 0 s")
    assert rig.call("resume").success
    slides = rig.statuses[-1].slides
    rig.graph.spin_until(lambda: rig.statuses[-1].slides > slides, "it to go on")


def test_one_that_is_no_mesh_is_refused_at_once(rig):
    rig.until("exploring", "somewhere")
    response = ask(rig, "/nowhere/cup.ply")
    assert not response.success
    assert "/nowhere/cup.ply" in response.message
    assert rig.statuses[-1].state == "exploring"
