"""The node over ur-rtde and a real connection, to a controller with each fault that a network or an arm can show."""

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from midastouch_common.message_arrays import stamp_ns
from midastouch_motion.nodes.ur_tf import UrTf
from midastouch_motion.ur.rtde import rtde_connector

from ..ur.controller_process import ADDRESS

pytestmark = [pytest.mark.dds, pytest.mark.slow]


def start(graph, timeout: float) -> UrTf:
    """The node, which takes an arm that is silent for `timeout` s for lost."""
    settings = {"robot_ip": ADDRESS, "timeout": timeout, "reconnect_period": 0.1}
    return graph.add(lambda **options: UrTf(rtde_connector(), **options), settings)


@pytest.mark.parametrize("fault", ["drop", "cut", "stall"])
def test_a_connection_that_fails_is_made_again(graph, ur_controller, fault):
    ur_controller(fault)
    node, sent, health = start(graph, timeout=0.3), graph.listen(TFMessage, "/tf"), graph.health()
    graph.spin_until(lambda: int(health.values.get("connections", 0)) >= 2, "the second connection")
    seen = len(sent)
    graph.spin_until(lambda: len(sent) > seen, "more transforms")
    stamps = np.array([stamp_ns(message.transforms[0].header.stamp) for message in sent])
    assert (np.diff(stamps) > 0).all()
    assert stamps[-1] <= node.get_clock().now().nanoseconds


def test_late_packages_have_the_time_of_their_measurement(graph, ur_controller):
    """The network holds some back for 200 ms and delivers them at once; their stamps do not show it."""
    ur_controller("bursts")
    start(graph, timeout=10.0)
    joints = graph.listen(JointState, "joint_states")
    graph.spin_until(lambda: len(joints) > 150, "some bursts")
    stamps = np.array([stamp_ns(joint.header.stamp) for joint in joints])
    measured = np.array([joint.position[0] for joint in joints])
    assert (np.diff(stamps) > 0).all()
    assert (np.diff(measured) > 0).all()
    # time of arrival would never be as far apart as the measurements, to the microsecond
    same = np.abs(1e-9 * np.diff(stamps) - np.diff(measured)) < 2e-6
    assert same[20:].mean() > 0.5
