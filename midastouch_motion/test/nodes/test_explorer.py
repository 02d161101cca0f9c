import re

import numpy as np
import pytest
from explorer_rig import BALL, Rig
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg
from visualization_msgs.msg import MarkerArray

from midastouch_common.frames import TRUTH_FRAME
from midastouch_common.ros import qos
from midastouch_filter.nodes.markers import object_mesh
from midastouch_motion.nodes.explorer import Explorer
from midastouch_msgs.msg import ExplorerStatus, FilterStatus, PoseMode, PoseModes, Suggestion

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("hasty")]


def test_it_explores_until_the_filter_knows(rig):
    rig.until("exploring", "somewhere")
    rig.state, rig.reason = "converged", "one mode is left, modulo symmetry: 6 poses alike"
    status = rig.until("known", "modulo symmetry: 6 poses alike")
    assert rig.ended
    assert not rig.node.gave_up
    assert status.slides >= 1
    assert status.path_length > 0.01


def test_a_filter_that_does_not_know_the_object_is_not_asked(rig):
    rig.advise()
    rig.state = "uninitialised"
    rig.untouched = "uninitialised"
    rig.graph.spin_until(lambda: rig.statuses and rig.statuses[-1].slides >= 4, "slides")
    assert not rig.asked
    assert rig.statuses[-1].state == "exploring"
    rig.state = "converged"
    rig.until("known")


def test_it_shows_what_is_really_there(rig):
    meshes = rig.graph.listen(MarkerArray, "explorer/object_mesh", latched=True)
    rig.graph.spin_until(lambda: meshes, "the mesh")
    marker = meshes[-1].markers[-1]
    assert marker.mesh_resource.endswith("/ball.ply")
    assert marker.header.frame_id == TRUTH_FRAME


def test_it_follows_suggestions_and_says_why(rig):
    step = Suggestion(heading=1.0, length=0.005, information=0.1, reason="a step")
    rim = Suggestion(heading=0.0, length=0.02, information=0.3, reason="the rim is there")
    rig.advise(success=True, suggestions=[step, rim])
    rig.until("exploring", "the rim is there")
    rig.graph.spin_until(lambda: len(rig.asked) >= 3, "it to ask again after each motion")
    assert rig.asked[0].lifts
    assert not [one for one in rig.statuses if one.reason == "a step"]
    rig.state = "converged"
    assert rig.until("known").slides >= 2


def moving(length, heading=0.0):
    """A response with a single suggestion."""
    return {"success": True, "suggestions": [Suggestion(heading=heading, length=length, information=0.4)]}


NO_MOTION = "heading and length are .*; give rad, and 0 to 1 m"


@pytest.mark.parametrize(
    ("response", "reason"),
    [
        ({"message": "nothing was felt yet"}, "nothing was felt yet$"),
        (moving(np.nan), NO_MOTION),
        (moving(np.inf), NO_MOTION),
        (moving(50.0), NO_MOTION),
        (moving(0.02, heading=np.nan), NO_MOTION),
    ],
)
def test_refused_and_impossible_suggestions_end_it(rig, response, reason):
    rig.advise(**response)
    assert re.search(f"no suggestion where to touch next: {reason}", rig.until("gave_up").reason)
    assert rig.node.gave_up
    assert len(rig.asked) == 3


def test_modes_that_are_no_poses_are_none(rig):
    modes = rig.graph.publisher(PoseModes, "pose_modes", qos.stream_publisher())
    mesh = object_mesh(f"file://{BALL}", Header(frame_id="object"))
    rig.graph.publisher(MarkerArray, "object_mesh", latched=True).publish(mesh)
    bad = PoseMode(weight=1.0)
    bad.pose.pose.orientation.w = 0.0

    def on_tf(message):
        modes.publish(PoseModes(header=message.transforms[0].header, modes=[bad]))

    rig.graph.companion.create_subscription(TFMessage, "/tf", on_tf, qos.TF)
    rig.until("exploring", "somewhere")
    slides = rig.statuses[-1].slides
    rig.graph.spin_until(lambda: rig.statuses[-1].slides > slides + 1, "two slides")


def test_a_filter_that_says_nothing_is_not_awaited_for_ever(graph):
    rig = Rig(graph, give_up_after=1.0)
    rig.silent = True
    assert "no answer on filter_status" in rig.until("gave_up").reason
    assert rig.node.gave_up


def test_a_filter_that_only_lags_behind_is_not_followed_for_ever(graph, patience_clock):
    rig = Rig(graph, give_up_after=1.0)
    rig.untouched, rig.reason = FilterStatus.STATE_STALE, "images are 28 s behind"
    status = rig.loses_patience(patience_clock, 0.05)  # though all images are answered
    assert "the filter is stale: images are 28 s behind" in status.reason
    assert status.path_length == 0
    assert rig.ended


def test_places_that_nothing_tells_apart_end_it(rig):
    rig.advise(success=True, indistinguishable=True, message="four sides are alike")
    status = rig.until("gave_up", "four sides are alike")
    assert status.lifts >= 3  # it went to look elsewhere


def test_another_object_than_the_known_ones_ends_it(rig):
    rig.until("exploring", "somewhere")
    rig.state, rig.reason, rig.unknown = "lost", "these touches are not of this mesh", 0.98
    rig.until("gave_up", "another object is touched, with 98.0%: these touches are not of this mesh")


def test_an_answer_that_is_lost_is_asked_for_again(rig):
    rig.until("exploring", "somewhere")
    rig.silent = True
    rig.more_images(4)  # while no answer comes
    rig.silent, rig.state = False, "converged"
    rig.until("known")


def test_statuses_that_answer_no_image_are_none(rig):
    """The filter says on its own clock that an object was changed, or that nothing comes."""
    rig.until("exploring", "somewhere")
    rig.silent = True
    at = rig.poses[-1]
    foreign = FilterStatus(state=FilterStatus.STATE_CONVERGED)
    foreign.header.stamp.sec = 2_000_000_000
    answers = rig.graph.publisher(FilterStatus, "filter_status", latched=True)
    for _ in range(10):
        answers.publish(foreign)
    rig.graph.spin_for(0.2)
    assert np.linalg.norm(rig.poses[-1][:3, 3] - at[:3, 3]) < 0.02
    assert not rig.ended


def test_without_an_arm_it_ends_and_says_what_is_missing(graph, patience_clock):
    """There are images and a filter, but nobody who moves the gel."""
    graph.add(Explorer, {"give_up_after": 1.0})
    statuses = graph.listen(ExplorerStatus, "explorer/status", latched=True)
    tf = graph.publisher(TFMessage, "/tf", qos.TF)
    answers = graph.publisher(FilterStatus, "filter_status", latched=True)
    heard = graph.listen(FilterStatus, "filter_status", latched=True)
    # older than any pose, whichever of two messages the explorer takes first: an answer of an image yet to come is none
    image = Header(stamp=graph.companion.get_clock().now().to_msg())

    def goes_on():
        tf.publish(tf_msg(graph.companion.get_clock().now().nanoseconds, np.eye(4)))
        answers.publish(FilterStatus(header=image, state=FilterStatus.STATE_NO_CONTACT))
        patience_clock.now = 0.02 * len(heard)
        return statuses and statuses[-1].state == ExplorerStatus.STATE_GAVE_UP

    graph.spin_until(goes_on, "an end")
    assert "no node offers the actions touch, slide, lift and approach" in statuses[-1].reason
