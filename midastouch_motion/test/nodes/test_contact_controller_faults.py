"""What goes wrong during a motion stops the arm."""

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped, WrenchStamped
from rclpy.duration import Duration
from std_msgs.msg import Header

from midastouch_common.ros import qos
from midastouch_msgs.action import Lift
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
        (setting(forces=False), "the newest force on the topic wrench", {"max_force": 10.0, "stale_after": 2.0}),
        (a_force_of_the_future, "ahead of the clock", {"max_force": 10.0}),
        (another_commander, "another node commands twists", {}),
    ],
)
def test_each_fault_stops_the_arm_and_is_the_reason(graph, fault, reason, parameters):
    rig = Rig(graph, **parameters)
    asked = rig.ask(Lift, height=0.2)
    asked.moves()
    fault(rig, graph)
    result = asked.ended()
    assert not result.success
    assert reason in result.message
    rig.until(lambda: not any(map(moving, rig.twists[-2:])), "two stops")


@pytest.mark.parametrize(("simulated", "seconds"), [(False, 100.0), (True, 100.0), (True, 0.9)])
def test_a_simulator_that_starts_again_stops_the_arm(graph, simulated, seconds):
    rig = Rig(graph, use_sim_time=simulated)
    asked = rig.ask(Lift, height=0.2)
    asked.moves()
    rig.late = seconds
    result = asked.ended()
    assert result.message == "time ran back"
    assert result.pose.header.frame_id == "", "where it was before says nothing"
    rig.late = 0.0
    rig.until(lambda: not any(map(moving, rig.twists[-2:])), "two stops")
