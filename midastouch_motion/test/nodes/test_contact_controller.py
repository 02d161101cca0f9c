import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, TwistStamped, Vector3
from goals import Asked
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Header

from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_motion.nodes.contact_controller import ContactController
from midastouch_msgs.action import Approach, Lift, Slide, Touch
from midastouch_msgs.msg import TactileContact

from .rig import Rig, moving

pytestmark = pytest.mark.dds


def posed(frame="base_link", w=1.0, x_of_turn=0.0, **position):
    """A pose, upright."""
    pose = Pose(position=Point(**position), orientation=Quaternion(w=w, x=x_of_turn))
    return PoseStamped(header=Header(frame_id=frame), pose=pose)


def test_an_approach_ends_where_it_was_sent(graph):
    rig = Rig(graph)
    asked = rig.ask(Approach, pose=posed(x=0.02))
    result = asked.ended()
    assert result.message.startswith("there, after")
    assert rig.position == pytest.approx([0.02, 0, 0], abs=2e-3)
    assert result.pose.header.frame_id == "base_link"
    assert result.pose.pose.position.x == pytest.approx(0.02, abs=2e-3)


def test_it_approaches_and_succeeds_once_the_depth_is_held(graph):
    rig = Rig(graph)
    asked = rig.ask(Touch, distance=0.05).moves()
    assert rig.twists[-1].header.frame_id == "digit_gel_frame"
    assert rig.twists[-1].twist.linear.z < 0
    rig.depth = 5e-4
    result = asked.ended()
    assert result.success, result.message
    assert result.depth == pytest.approx(5e-4, abs=2e-4)
    assert asked.feedback[-1].area == pytest.approx(2e-5)
    rig.until(lambda: len(rig.twists) > 1 and not any(map(moving, rig.twists[-2:])), "two stops")


def test_the_terminal_names_what_motions_wait_for(graph, capfd):
    said = []

    def says(words):
        said.append(capfd.readouterr().err)
        return words in "".join(said)

    rig = Rig(graph)
    rig.enabled = False
    rig.until(
        lambda: says("no motion can begin: not enabled: ~/enable has to be repeated"), "that it has to be enabled"
    )
    rig.enabled = True
    rig.until(lambda: says("ready for motions"), "that it is ready")


@pytest.mark.parametrize(
    ("missing", "reason", "parameters"),
    [("enabled", "not enabled", {}), ("forces", "no force on wrench_topic", {"max_force": 10.0})],
)
def test_nothing_moves_before_it_is_enabled_and_watched(graph, missing, reason, parameters):
    rig = Rig(graph, **parameters)
    setattr(rig, missing, False)
    assert reason in rig.ask(Lift, height=0.01).ended().message
    assert not any(map(moving, rig.twists))


def test_without_a_limit_of_force_nobody_has_to_measure_one(graph):
    rig = Rig(graph)
    rig.forces = False
    rig.ask(Lift, height=0.2).moves()


def in_the_way(rig):
    return rig.node.describe()[2]["in_the_way"]


@pytest.mark.parametrize("reader", ["recorder", "rosbag2_recorder"])
def test_who_records_twists_follows_none(graph, reader):
    rig = Rig(graph)
    rig.until(lambda: in_the_way(rig) == "nothing", "all to be seen")
    recorder = graph.add(Node, node_name=reader)
    recorder.create_subscription(TwistStamped, "delta_twist_cmds", lambda _: None, qos.stream_subscriber())
    for each in [*graph.companion.subscriptions]:
        if each.topic_name == "/delta_twist_cmds":
            graph.companion.destroy_subscription(each)
    rig.until(lambda: in_the_way(rig).startswith("nothing subscribes to the twists"), "the arm to be missed")


def test_without_transforms_these_are_missed_and_not_the_arm(graph):
    rig = Rig(graph)
    rig.poses = False
    rig.until(lambda: in_the_way(rig) == "no transform of the gel came yet", "transforms to be missed")


@pytest.mark.parametrize("bad", ["depth", "points"])
def test_what_is_not_finite_is_no_image(graph, bad):
    rig = Rig(graph, stale_after=2.0)
    rig.depth = 5e-4
    asked = rig.ask(Slide, length=0.2).moves()
    rig.bad = bad
    assert "the newest image is" in asked.ended().message
    twists = [each.twist for each in rig.twists]
    assert all(np.isfinite([t.linear.x, t.linear.y, t.linear.z, t.angular.x, t.angular.y]).all() for t in twists)


@pytest.mark.parametrize(("state", "reason"), [("saturated", "covers the view"), ("unknown", "neither a contact nor")])
def test_what_cannot_be_read_ends_a_slide(graph, state, reason):
    rig = Rig(graph, stale_after=2.0)
    rig.depth = 5e-4
    asked = rig.ask(Slide, length=0.2).moves()
    rig.state = state
    rig.until(lambda: in_the_way(rig).find(reason) >= 0, "the reason")
    rig.depth, rig.state = 1e-4, "contact"
    assert reason in asked.ended().message


def test_a_cancelled_motion_stops(graph):
    rig = Rig(graph)
    asked = rig.ask(Lift, height=0.2).moves()
    rig.until(lambda: asked.handle is not None, "the goal's handle")
    asked.handle.cancel_goal_async()
    assert asked.ended().message == "cancelled"
    rig.until(lambda: not any(map(moving, rig.twists[-2:])), "two stops")
    assert rig.ask(Lift, height=0.2).moves(), "the next goal is carried out"


def test_one_motion_at_a_time(graph):
    rig = Rig(graph)
    first = rig.ask(Lift, height=0.2).moves()
    assert "carrying out a lift" in rig.ask(Touch, distance=0.01).ended().message
    assert first.result is None


def test_a_deactivated_node_stops_and_refuses(graph):
    rig = Rig(graph)
    rig.depth = 5e-4
    asked = rig.ask(Slide, length=0.2).moves()
    assert graph.change_state("contact_controller", "deactivate")
    assert "deactivated" in asked.ended().message
    assert asked.result.depth > 0
    assert not moving(rig.twists[-1])
    assert graph.change_state("contact_controller", "activate")
    rig.ask(Lift, height=0.2).moves()


def test_a_node_that_is_not_configured_refuses(graph):
    graph.add(ContactController, {"autostart": False})
    assert "not active" in Asked(graph.companion, graph.spin_until, Lift, height=0.01).ended().message


def test_an_image_that_is_ahead_of_the_clock_is_none(graph):
    """One of a wrong stamp, of which no later one is newer."""
    rig = Rig(graph, air_speed=2e-3)  # the lift takes 100 s
    asked = rig.ask(Lift, height=0.2).moves()
    ahead = (graph.companion.get_clock().now() + Duration(seconds=1000.0)).to_msg()
    images = graph.publisher(TactileContact, "tactile/contact", qos.stream_publisher())

    def is_said() -> bool:
        images.publish(TactileContact(header=Header(stamp=ahead)))  # which the next one may take the place of
        return "early_images" in rig.node.diagnostics.counts

    rig.until(is_said, "the word of it")
    asked.moves()
    assert asked.result is None


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_a_direction_is_one_of_any_length(graph, size):
    rig = Rig(graph)
    rig.ask(Touch, distance=0.05, direction=Vector3(x=size, z=-size)).moves()
    linear = next(each.twist.linear for each in rig.twists if moving(each))
    assert np.isfinite([linear.x, linear.y, linear.z]).all()
    assert linear.x > 0
    assert linear.z == pytest.approx(-linear.x)


@pytest.mark.parametrize(
    ("kind", "goal", "reason"),
    [
        (Touch, {"distance": 0.0}, "distance 0 is not between"),
        (Touch, {"distance": 0.01, "depth": 0.1}, "depth 0.1 is not between 0.0001 and max_depth"),
        (Touch, {"distance": 0.01, "depth": 1e-9}, "depth 1e-09 is not between"),
        (Slide, {"length": 0.01, "depth": 1e-9}, "depth 1e-09 is not between"),
        (Touch, {"distance": 0.01, "direction": Vector3(x=float("nan"))}, "direction: not finite"),
        (Slide, {"length": -1.0}, "length -1 is not between"),
        (Slide, {"length": 0.1, "heading": float("inf")}, "heading: not finite"),
        (Lift, {"height": float("nan")}, "height nan is not between"),
        (Slide, {"length": 0.05}, "touch first"),
        (Approach, {"pose": posed("map")}, "it is in 'map'; give it in 'base_link'"),
        (Approach, {"pose": posed(x=float("nan"))}, "non-finite"),
        (Approach, {"pose": posed(w=0.0)}, "zero quaternion"),
        (Approach, {"pose": posed(z=2.0)}, "outside of the box"),
        (Approach, {"pose": posed(x_of_turn=1.0)}, "outside of the cone"),
    ],
)
def test_a_goal_that_makes_no_sense_is_refused(graph, kind, goal, reason):
    rig = Rig(graph, max_tilt=1.4)
    assert reason in rig.ask(kind, **goal).ended().message
    assert not any(map(moving, rig.twists))


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"depth": 1.5e-3}, "not less than max_depth"),
        ({"max_force": 10.0, "wrench_topic": ""}, "max_force: it needs a force, and wrench_topic is empty"),
        ({"max_depth": 2.5e-3}, "max_depth: 0.0025 m is deeper than images show, 0.002 m"),
        ({"box_low": [0.0, 0.0, 2.0]}, "the box from .* is empty"),
    ],
)
def test_parameters_that_contradict_each_other_are_refused(graph, parameters, reason):
    with pytest.raises(InputError, match=reason):
        graph.add(ContactController, parameters)
