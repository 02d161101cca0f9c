"""What goes wrong during a motion stops the arm."""

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped, WrenchStamped
from rclpy.duration import Duration
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg

from midastouch_common import se3
from midastouch_common.ros import qos
from midastouch_msgs.action import Lift, Slide
from midastouch_msgs.msg import FilterStatus

from .rig import Rig, moving

pytestmark = pytest.mark.dds


def setting(**attributes):
    """A fault of the rig: these attributes of it change."""
    return lambda rig, _graph: vars(rig).update(attributes)


def lost(rig, graph):
    graph.publisher(FilterStatus, "filter_status", latched=True).publish(FilterStatus(state="lost"))


def a_force_of_the_future(rig, graph):
    rig.forces = False
    ahead = graph.companion.get_clock().now() + Duration(seconds=1000.0)
    message = WrenchStamped(header=Header(stamp=ahead.to_msg()))
    graph.publisher(WrenchStamped, "wrench", qos.stream_publisher()).publish(message)


def another_commander(rig, graph):
    graph.companion.create_publisher(TwistStamped, "delta_twist_cmds", qos.stream_publisher())


@pytest.mark.parametrize(
    ("fault", "reason", "parameters"),
    [
        (setting(follows=False), "the arm does not follow", {}),
        (setting(enabled=False), "not enabled", {"hold": 2.0}),
        (setting(images=False), "the newest image is", {"stale_after": 2.0}),
        (setting(poses=False), "the newest transform of the gel is", {"stale_after": 2.0}),
        (setting(position=np.array([5.0, 0, 0])), "outside of the box", {}),
        (lost, "the filter is lost", {}),
        (setting(force=12.0), "a force of 12.0 N, more than 10.0", {"max_force": 10.0}),
        (setting(forces=False), "the newest force on wrench_topic", {"max_force": 10.0, "stale_after": 2.0}),
        (setting(forces=False), "the newest force on wrench_topic", {"stale_after": 2.0}),
        (setting(felt_in="elsewhere"), "wrench_topic: TF does not link its frame 'elsewhere' to the gel", {}),
        (setting(force=np.nan), "wrench_topic: the force is not finite", {}),
        (a_force_of_the_future, "ahead of the clock", {"max_force": 10.0}),
        (another_commander, "another node commands twists", {}),
    ],
)
def test_each_fault_stops_the_arm_and_is_the_reason(graph, fault, reason, parameters):
    rig = Rig(graph, **parameters)
    asked = rig.ask(Lift, height=0.2).moves()
    fault(rig, graph)
    result = asked.ended()
    assert not result.success
    assert reason in result.message
    rig.until(lambda: not any(map(moving, rig.twists[-2:])), "two stops")


TOOL = se3.exp(np.array([0, 0, 0, -np.pi / 2, 0, 0]))
"""T_gel_tool (4, 4): the gel's z axis is the tool's y axis backwards."""


@pytest.mark.parametrize(
    ("force", "reason"),
    [
        ((0.0, -9.0, 0.0), "0.0 N across the gel and 9.0 onto it, of which its depth explains"),
        ((9.0, 0.0, 0.0), "9.0 N across the gel and 0.0 onto it"),
        ((0.0, 9.0, 0.0), "the sign or the frame of the wrench is wrong"),
    ],
)
def test_a_force_that_the_depth_does_not_explain_ends_a_slide(graph, force, reason):
    """Measured along the axes of a tool, with a bias."""
    rig, bias = Rig(graph), np.array([3.0, 0.0, 4.0])
    graph.publisher(TFMessage, "/tf_static", qos.latched()).publish(tf_msg(0, TOOL, "digit_gel_frame", "tool"))
    rig.felt_in, rig.force = "tool", tuple(bias)
    assert rig.ask(Lift, height=2e-3).ended().success
    assert "bias 5.0 N" in rig.node.describe()[2]["force"]
    rig.depth = 5e-4
    rig.until(lambda: rig.node.describe()[2]["depth_mm"] == "0.50", "the contact")
    asked = rig.ask(Slide, length=0.2).moves()
    rig.force = tuple(bias + force)
    height = rig.position[2]
    assert reason in asked.ended().message
    assert rig.position[2] > height + 1e-3, "pulled back"


def test_an_arm_without_forces_says_so(graph):
    rig = Rig(graph, wrench_topic="")
    rig.ask(Lift, height=0.2).moves()
    assert "none comes" in rig.node.describe()[2]["force"]


@pytest.mark.parametrize(("simulated", "seconds"), [(False, 100.0), (True, 100.0), (True, 0.9)])
def test_a_simulator_that_starts_again_stops_the_arm(graph, simulated, seconds):
    rig = Rig(graph, use_sim_time=simulated)
    asked = rig.ask(Lift, height=0.2).moves()
    rig.late = seconds
    result = asked.ended()
    assert result.message == "time ran back"
    assert result.pose.header.frame_id == "", "where it was before says nothing"
    rig.late = 0.0
    rig.until(lambda: not any(map(moving, rig.twists[-2:])), "two stops")
