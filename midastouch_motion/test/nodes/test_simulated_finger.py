"""The finger as an arm that offers actions, with a stand-in for the filter that answers its images."""

import numpy as np
import pytest
from explorer_rig import TOOL, AnsweredFinger
from geometry_msgs.msg import PoseStamped, Vector3
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from midastouch_common import se3
from midastouch_common.frames import BASE_FRAME
from midastouch_common.message_arrays import pose_from_msg, stamp_ns
from midastouch_common.ros.conversions import pose_to_msg
from midastouch_msgs.action import Approach, Lift, Slide, Touch
from midastouch_msgs.srv import SetObject
from midastouch_perception.nodes import tdn
from midastouch_simulation.nodes.simulated_finger import PARAMETERS

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("hasty")]


def default(parameters, name):
    return next(one.default for one in parameters if one.name == name)


@pytest.fixture
def rig(graph):
    return AnsweredFinger(graph)


def posed(pose, frame=BASE_FRAME):
    return PoseStamped(header=Header(frame_id=frame), pose=pose_to_msg(pose))


def test_it_touches_slides_lifts_and_approaches_like_an_arm(rig):
    touch = rig.do(Touch, distance=0.05)
    assert touch.success, touch.message
    assert 4e-4 < touch.depth < 1.1e-3
    assert rig.touches
    slide = rig.do(Slide, heading=1.0, length=0.02)
    assert slide.success
    assert slide.path == pytest.approx(0.02, abs=2e-3)
    lift = rig.do(Lift, height=0.02)
    assert (lift.success, lift.depth) == (True, 0.0)
    goal = rig.gels[-1] @ se3.exp(np.array([0.03, 0, 0.02, 0.3, 0, 0]))
    approach = rig.do(Approach, pose=posed(goal))
    assert approach.success
    ended = rig.stamps.index(stamp_ns(approach.pose.header.stamp))
    for gel in rig.gels[ended:]:  # images at rest may have followed
        np.testing.assert_allclose(gel, goal, atol=1e-6)
    np.testing.assert_allclose(pose_from_msg(approach.pose.pose), goal, atol=1e-6)
    assert approach.pose.header.frame_id == BASE_FRAME
    assert set(np.diff(rig.stamps)) == {round(1e9 / 30)}
    steps = np.linalg.norm(np.diff([gel[:3, 3] for gel in rig.gels], axis=0), axis=1)
    assert steps.max() < 4 * 1.5 * 0.05 / 30  # in the air it is four times as fast


def test_it_moves_only_once_tdn_has_enough_untouched_images(graph):
    """Else a contact becomes part of the background, and is felt to the end in images without one."""
    needed = default(tdn.PARAMETERS, "background_frames")
    assert default(PARAMETERS, "untouched_frames") >= needed
    rig = AnsweredFinger(graph, untouched_frames=needed)
    rig.do(Touch, distance=0.05)
    assert np.ptp([gel[:3, 3] for gel in rig.gels[:needed]], axis=0).max() == 0


def test_while_the_filter_lags_behind_it_does_not_begin(rig):
    rig.untouched = "stale"
    touch = rig.ask(Touch, distance=0.05)
    rig.more_images(5)
    assert touch.result is None
    assert np.ptp([gel[:3, 3] for gel in rig.gels], axis=0).max() == 0
    rig.untouched = "no_contact"
    touch.ended()


def test_a_goal_ends_only_once_its_images_are_answered(rig):
    rig.do(Touch, distance=0.05)
    slide = rig.ask(Slide, heading=0.0, length=3e-3)
    rig.silent = True
    rig.graph.spin_until(lambda: slide.feedback, "feedback")
    rig.more_images(3)  # while no answer comes
    assert slide.result is None
    rig.silent = False
    ended = slide.ended()
    assert stamp_ns(slide.feedback[-1].header.stamp) in rig.stamps
    assert slide.feedback[-1].path == pytest.approx(ended.path)


def test_one_motion_at_a_time_and_a_cancelled_one_ends(rig):
    rig.do(Touch, distance=0.05)
    slide = rig.ask(Slide, heading=0.0, length=2.0)
    rig.graph.spin_until(lambda: slide.feedback and slide.handle, "a motion, and its handle")
    rig.silent = True  # so that it does not come to its end
    assert rig.do(Lift, height=0.01).message == "the finger is carrying out a slide; cancel it first"
    slide.handle.cancel_goal_async()
    assert slide.ended().message == "cancelled"
    assert slide.result.path > 0


def test_a_goal_that_makes_no_sense_is_refused(rig):
    assert "distance 0 is not between" in rig.do(Touch, distance=0.0).message
    assert "give it in 'base_link'" in rig.do(Approach, pose=posed(np.eye(4), "map")).message


def test_it_touches_in_another_direction_if_it_is_told_one(rig):
    ended = rig.do(Touch, distance=0.03, direction=Vector3(z=1.0))
    assert not ended.success
    assert "nothing on which it fits touched within 30 mm" in ended.message


def test_the_object_is_pushed_and_the_finger_stays(rig):
    rig.do(Touch, distance=0.05)
    before, gel = rig.objects[-1], rig.gels[-1]
    assert rig.graph.call(Trigger, "simulated_finger/push", Trigger.Request()).success
    turned = lambda: np.linalg.norm(rig.objects[-1][:3, :3] - before[:3, :3])  # noqa: E731
    rig.graph.spin_until(lambda: turned() > 0.1, "the object to move")
    assert np.linalg.norm(rig.gels[-1][:3, 3] - gel[:3, 3]) < 1e-3


def test_another_object_is_put_there(rig):
    def put(path):
        return rig.graph.call(SetObject, "simulated_finger/set_object", SetObject.Request(mesh_path=path))

    assert "/nowhere/cup.ply" in put("/nowhere/cup.ply").message
    rig.do(Touch, distance=0.05)
    assert put(TOOL).success
    assert rig.do(Touch, distance=0.05).success, "it begins over the new one"
