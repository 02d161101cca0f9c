"""The finger's interactive marker, with a viewer that does what RViz is recorded to do."""

import numpy as np
import pytest
from explorer_rig import RADIUS, TOOL, Rig
from geometry_msgs.msg import Point, PointStamped
from marker_viewer import FACTS, FINGER, Viewer
from std_msgs.msg import Header
from visualization_msgs.msg import InteractiveMarkerControl, InteractiveMarkerUpdate, MenuEntry

from midastouch_common.frames import BASE_FRAME, TRUTH_FRAME
from midastouch_common.ros import qos

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("hasty")]
NEAR = 1.5e-3  # m: half a step of 50 mm/s at 30 Hz, and how deep the gel is pressed in


def looked_at(graph, **parameters):
    """One that explores, with a viewer."""
    rig = Rig(graph, **parameters)
    rig.health = graph.health()
    rig.viewer = Viewer(graph)
    rig.until("exploring", "somewhere")
    return rig


def hold(rig):
    """Take the finger, and let it come to rest."""
    rig.viewer.choose("pause")
    rig.until("paused", "a person has the finger")
    rest(rig)
    return rig


@pytest.fixture
def rig(graph):
    return looked_at(graph)


@pytest.fixture
def held(rig):
    return hold(rig)


def rest(rig):
    """Spin until the last order is carried out and the viewer has seen that."""
    asked = len(rig.poses) + 3
    rig.graph.spin_until(
        lambda: (
            len(rig.poses) > asked
            and np.allclose(rig.poses[-1], rig.poses[-3])
            and np.allclose(rig.viewer.pose, rig.gels[-1], atol=1e-6)
        ),
        "the finger to rest, and its marker with it",
    )


def elsewhere(rig, degrees):
    """A place (3,) of the ball, so far from where the finger is."""
    here = rig.poses[-1][:3, :3]
    return RADIUS * (here @ (np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))))


def distance_to(rig, place):
    return np.linalg.norm(rig.poses[-1][:3, 3] - place)


def in_base(rig, place):
    """A place (3,) of the object, where the marker's frame has it."""
    return (rig.objects[-1] @ [*place, 1.0])[:3]


def test_a_viewer_gets_a_marker_with_a_menu_and_one_control(rig):
    marker = rig.viewer.marker
    assert (marker.name, marker.header.frame_id) == ("finger", BASE_FRAME)
    assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (0, 0)  # it is where it is at any time
    assert [entry.title for entry in marker.menu_entries] == ["pause", "resume", "push", "lift"]
    assert all(entry.id and not entry.parent_id for entry in marker.menu_entries)
    assert {entry.command_type for entry in marker.menu_entries} == {MenuEntry.FEEDBACK}
    (control,) = marker.controls
    assert control.interaction_mode == InteractiveMarkerControl.MOVE_3D
    assert control.markers
    names = {name: kinds[0] for name, kinds in rig.node.get_service_names_and_types()}
    assert names[f"/{FINGER}/get_interactive_markers"] == FACTS["names"]["get_interactive_markers"]


def test_it_follows_without_a_gap_and_is_silent_at_rest(held):
    for degrees in (40, 50):
        slides = held.statuses[-1].slides
        held.viewer.drag(in_base(held, elsewhere(held, degrees)))
        held.graph.spin_until(lambda slides=slides: held.statuses[-1].slides > slides, "the slide")
        rest(held)
    numbers = held.viewer.numbers  # the first ones may be lost while both sides still find each other
    assert held.viewer.number < numbers[-1]
    assert set(np.diff(numbers)) == {FACTS["client"]["next_number"]}
    assert set(held.viewer.kinds) == {InteractiveMarkerUpdate.UPDATE}
    said = len(numbers)
    held.graph.spin_for(0.2)
    assert len(numbers) == said
    late = Viewer(held.graph, "late")
    assert late.number == numbers[-1]
    assert np.allclose(late.pose, held.gels[-1], atol=1e-6)


def test_where_it_is_dropped_the_finger_slides(held):
    slides, place = held.statuses[-1].slides, elsewhere(held, 40)
    held.viewer.drag(in_base(held, 1.1 * place))  # the camera's plane leaves the surface
    held.until("paused", "shows the finger where to touch")
    held.graph.spin_until(lambda: held.statuses[-1].slides > slides, "the slide")
    rest(held)
    assert distance_to(held, place) < NEAR
    held.viewer.choose("resume")
    held.state = "converged"
    held.until("known")


def test_it_goes_near_what_it_cannot_touch_and_says_so(graph):
    # it begins far from the centre: the filter there is one of a ball
    rig = hold(looked_at(graph, mesh=TOOL, seed=3))
    groove = np.array([25.3, -6.2, -10.4]) * 1e-3  # where the grip enters the head
    rig.viewer.drag(in_base(rig, groove))
    rig.health.until("cannot touch handle_tool at (425.3, -156.2, 239.6) mm")
    rest(rig)
    assert NEAR < distance_to(rig, groove) < 0.045


def test_a_click_that_drags_nothing_moves_nothing(rig):
    here = rig.viewer.pose[:3, 3]
    rig.viewer.does("press", here)
    rig.viewer.does("release", here)
    rig.viewer.choose("pause")
    rig.until("paused", "a person has the finger")
    assert not [one for one in rig.statuses if "where to touch" in one.reason]


def test_the_menu_does_what_the_services_do(held):
    before, lifts = held.objects[-1], held.statuses[-1].lifts
    held.viewer.choose("push")
    held.graph.spin_until(lambda: np.linalg.norm(held.objects[-1] - before) > 0.05, "the object to move")
    held.viewer.choose("lift")
    held.graph.spin_until(lambda: held.statuses[-1].lifts > lifts, "the lift")
    held.viewer.choose("resume")
    held.until("exploring", "going on by itself")


def test_of_two_viewers_the_one_that_grasped_last_has_it(held):
    other, place = Viewer(held.graph, "other"), elsewhere(held, 40)
    here = held.viewer.pose[:3, 3]
    held.viewer.does("press", here)
    other.does("press", here)
    held.viewer.does("release", in_base(held, elsewhere(held, -40)))
    other.does("release", in_base(held, place))
    held.until("paused", "shows the finger where to touch")
    held.health.until("feedback of 'rviz': it lets the finger go")
    rest(held)
    assert distance_to(held, place) < NEAR


BAD = (
    ("press", 0.0, {"marker_name": "arm"}, "there is no marker 'arm'"),
    ("release", np.nan, {}, "its position is [nan"),
    ("release", 0.0, {"client_id": "stranger"}, "of 'stranger': it lets the finger go"),
    ("menu", 0.0, {"menu_entry_id": 99}, "the menu has no entry 99"),
)


def test_bad_feedback_is_counted_and_said(held):
    for what, position, fields, words in BAD:
        held.viewer.does(what, np.full(3, position), **fields)
        held.health.until(words)
    assert held.statuses[-1].state == "paused"
    assert int(held.health.values["refused_feedback"]) >= len(BAD)


def test_a_foreign_or_far_drop_is_refused_and_the_marker_returns(held):
    before = held.gels[-1]
    for frame, distance, words in ("map", 0.01, "it is in 'map'"), (BASE_FRAME, 1e300, "beyond 3 m"):
        said = len(held.viewer.numbers)
        held.viewer.marker.header.frame_id = frame
        held.viewer.drag(np.full(3, distance))
        held.health.until(words)
        held.graph.spin_until(lambda said=said: len(held.viewer.numbers) > said, "an update")
    assert np.allclose(held.viewer.pose, before, atol=1e-6)
    assert np.allclose(held.gels[-1], before)


def test_what_a_person_shows_before_the_first_touch_is_refused(graph):
    rig = Rig(graph)
    rig.silent = True
    rig.health = graph.health()
    viewer = Viewer(graph)
    viewer.choose("push")
    rig.health.until("push: not while waiting")
    viewer.drag(np.full(3, 0.01))
    rig.health.until("not while waiting: for an arm")


def test_a_click_on_the_object_sends_the_finger_there(held):
    clicks = held.graph.publisher(PointStamped, "clicked_point", qos.COMMAND)
    for frame, degrees in (TRUTH_FRAME, 60), (BASE_FRAME, 40):
        place = elsewhere(held, degrees)
        shown = place if frame == TRUTH_FRAME else (held.objects[-1] @ [*place, 1.0])[:3]
        point = Point(**dict(zip("xyz", shown, strict=True)))
        clicks.publish(PointStamped(header=Header(frame_id=frame), point=point))
        rest(held)
        assert distance_to(held, place) < NEAR
    held.until("paused", "shows the finger where to touch")
