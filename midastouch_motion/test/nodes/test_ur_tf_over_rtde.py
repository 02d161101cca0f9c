"""The node over ur-rtde and a real connection, to a controller with each fault that a network or an arm can show."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from midastouch_common.message_arrays import stamp_ns
from midastouch_motion.nodes.ur_tf import UrTf
from midastouch_motion.ur.rtde import rtde_connector

from ..ur.controller_process import ADDRESS
from ..ur.ur_controller import WRENCH

pytestmark = [pytest.mark.dds, pytest.mark.slow]


class Arm:
    """The node and what it says."""

    def __init__(self, graph, timeout: float = 0.3):
        settings = {"robot_ip": ADDRESS, "timeout": timeout, "reconnect_period": 0.1}
        self.node = graph.add(lambda **options: UrTf(rtde_connector(), **options), settings)
        self.tf = graph.listen(TFMessage, "/tf")
        self.joints = graph.listen(JointState, "joint_states")
        self.wrenches = graph.listen(WrenchStamped, "wrench")
        self.reports = graph.listen(DiagnosticArray, "/diagnostics")

    def said(self, words: str) -> bool:
        return any(words in s.message for report in self.reports for s in report.status)

    def connections(self) -> int:
        return max(
            (int(v.value) for r in self.reports for s in r.status for v in s.values if v.key == "connections"),
            default=0,
        )

    def stamps(self) -> np.ndarray:
        return np.array([stamp_ns(m.transforms[0].header.stamp) for m in self.tf])


def test_the_force_is_that_of_the_controller(graph, ur_controller):
    ur_controller()
    arm = Arm(graph)
    graph.spin_until(lambda: arm.wrenches, "a force")
    felt = arm.wrenches[-1]
    assert felt.header.frame_id == "base"
    assert [felt.wrench.force.x, felt.wrench.force.y, felt.wrench.force.z] == WRENCH[:3]


@pytest.mark.parametrize("fault", ["drop", "cut", "stall"])
def test_a_connection_that_fails_is_made_again(graph, ur_controller, fault):
    ur_controller(fault)
    arm = Arm(graph)
    graph.spin_until(lambda: arm.connections() >= 2, "the second connection")
    seen = len(arm.tf)
    graph.spin_until(lambda: len(arm.tf) > seen, "more transforms")
    assert (np.diff(arm.stamps()) > 0).all()
    assert arm.stamps()[-1] <= arm.node.get_clock().now().nanoseconds


def test_a_controller_that_is_switched_off_and_on(graph, ur_controller):
    first = ur_controller()
    arm = Arm(graph)
    graph.spin_until(lambda: arm.tf, "transforms")
    first.end()
    graph.spin_until(lambda: arm.said(f"no RTDE at {ADDRESS}"), "the error")
    ur_controller()
    arm.tf.clear()
    graph.spin_until(lambda: arm.tf, "transforms again")


def test_late_packages_have_the_time_of_their_measurement(graph, ur_controller):
    """The network holds some back for 200 ms and delivers them at once; their stamps do not show it."""
    ur_controller("bursts")
    arm = Arm(graph, timeout=10.0)
    graph.spin_until(lambda: len(arm.joints) > 150, "some bursts")
    stamps = np.array([stamp_ns(joint.header.stamp) for joint in arm.joints])
    measured = np.array([joint.position[0] for joint in arm.joints])
    assert (np.diff(stamps) > 0).all()
    assert (np.diff(measured) > 0).all()
    # time of arrival would never be as far apart as the measurements, to the microsecond
    same = np.abs(1e-9 * np.diff(stamps) - np.diff(measured)) < 2e-6
    assert same[20:].mean() > 0.5


@pytest.mark.parametrize("fault", ["old protocol", "unknown output", "refused start"])
def test_a_controller_that_does_not_speak_this_rtde_is_an_error(graph, ur_controller, fault):
    ur_controller(fault)
    arm = Arm(graph)
    graph.spin_until(lambda: arm.said("no RTDE at") or arm.said("no new sample"), "the error")
    assert arm.tf == []
