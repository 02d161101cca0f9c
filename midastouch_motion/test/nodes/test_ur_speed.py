"""The node over a follower that writes down its orders, and over ur-rtde and a controller."""

import sys

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_motion.nodes import ur_speed
from midastouch_motion.nodes.ur_speed import UrSpeed
from midastouch_motion.ur.rtde import transform_from_rtde

from ..ur.controller_process import ADDRESS, BASE_FROM_TCP

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("brisk_health")]
TCP_OFFSET = [0.0, 0.01, 0.12, 0.0, 0.3, 0.0]
TOOL_FROM_GEL = transform_from_rtde(np.array([0.02, -0.03, 0.15, 1.2, -0.4, 0.7]))
TWIST = np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.3])


class Followed:
    """Stands for the process: it keeps what is sent."""

    trouble, connections, broken_off = "", 1, False

    def __init__(self, *_):
        self.sent, self.closed = [], False

    def send(self, twist):
        self.sent.append(twist)

    def close(self):
        self.closed = True


class Rig:
    """The node, a mount on TF, and somebody who sends twists. Attribute: follower, if it is a stand-in."""

    def __init__(self, graph, real=False, mount=True, **parameters):
        self.graph, self.follower = graph, None
        settings = {"robot_ip": ADDRESS, "tcp_offset": TCP_OFFSET, "timeout": 10.0, "reconnect_period": 0.1}
        stand_in = {} if real else {"make_follower": self._make}
        self.node = graph.add(lambda **options: UrSpeed(**stand_in, **options), settings | parameters)
        self.health = graph.health()
        if real:
            self.connected()
        self._twists = graph.publisher(TwistStamped, "delta_twist_cmds", qos.stream_publisher())
        self._tf = graph.publisher(TFMessage, "/tf_static", qos.latched())
        if mount:
            self._tf.publish(tf_msg(0, TOOL_FROM_GEL, "tool0"))

    def _make(self, *arguments):
        self.follower = Followed(*arguments)
        return self.follower

    def connected(self):
        self.health.clear()
        said = lambda: [one.message for one in self.health.statuses]  # noqa: E731
        self.graph.spin_until(lambda: "connected" in said(), "the connection")

    def send(self, twist=TWIST, frame="digit_gel_frame"):
        message = TwistStamped(header=Header(frame_id=frame))
        linear, angular = (Vector3(**dict(zip("xyz", part, strict=True))) for part in np.reshape(twist, (2, 3)))
        message.twist.linear, message.twist.angular = linear, angular
        self._twists.publish(message)

    def until(self, done, what, **twist):
        """Send twists until that."""

        def step():
            self.send(**twist)
            return done()

        self.graph.spin_until(step, what)


def expected(twist):
    """Velocity of the TCP along the axes of `base`, from where gel and TCP are in it."""
    gel = BASE_FROM_TCP @ se3.inverse(transform_from_rtde(np.array(TCP_OFFSET))) @ TOOL_FROM_GEL
    linear, angular = gel[:3, :3] @ twist[:3], gel[:3, :3] @ twist[3:]
    return np.concatenate([linear + np.cross(angular, BASE_FROM_TCP[:3, 3] - gel[:3, 3]), angular])


@pytest.fixture
def moved(ur_controller, graph):
    """A controller that was told a speed, and the rig that moves it."""
    controller, rig = ur_controller(), Rig(graph, real=True)
    rig.until(lambda: controller.said("speed"), "a speed")
    return controller, rig


def test_a_twist_of_the_gel_moves_the_tcp(moved):
    controller, _ = moved
    np.testing.assert_allclose(controller.said("speed")[-1], expected(TWIST), atol=1e-9)


def test_a_deactivated_node_stops_the_arm(moved, graph):
    controller, rig = moved
    assert graph.change_state("ur_speed", "deactivate")
    graph.spin_until(lambda: controller.said("stopped"), "the end of the program")
    assert controller.said("speed_stop")
    assert graph.change_state("ur_speed", "activate")
    rig.connected()
    before = len(controller.said("speed"))
    rig.until(lambda: len(controller.said("speed")) > before, "another speed")


def test_a_lost_connection_is_reported_and_made_again(moved, ur_controller):
    first, rig = moved
    first.end()
    rig.health.until(f"no RTDE at {ADDRESS}")
    second = ur_controller()
    rig.connected()
    rig.until(lambda: second.said("speed"), "a speed again")


def test_a_twist_that_is_refused_stops_the_arm(graph):
    rig = Rig(graph, max_speed=0.05)
    rig.until(lambda: rig.follower.sent and rig.follower.sent[-1].any(), "an order")
    rig.until(lambda: rig.health.says("faster than max_speed, 0.05"), "the reason", twist=10 * TWIST)
    assert not rig.follower.sent[-1].any()


def test_a_motion_that_was_broken_off_is_reported(graph):
    rig = Rig(graph)
    rig.follower.broken_off = True
    rig.health.until("the motion was broken off")


def test_without_a_mount_nothing_moves(graph):
    rig = Rig(graph, mount=False)
    rig.until(lambda: rig.health.says("TF has no pose of digit_gel_frame on tool0"), "the reason")
    assert not any(twist.any() for twist in rig.follower.sent)


def test_a_destroyed_node_closes_its_follower(graph):
    rig = Rig(graph)
    graph.remove(rig.node)
    assert rig.follower.closed


@pytest.mark.parametrize(
    ("settings", "reason"),
    [({"use_sim_time": True, "robot_ip": "the.arm"}, "use_sim_time"), ({}, "parameter 'robot_ip' is empty")],
)
def test_what_cannot_be(graph, settings, reason):
    with pytest.raises(InputError, match=reason):
        graph.add(lambda **options: UrSpeed(Followed, **options), settings)


def test_a_missing_package_is_named(monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "rtde_receive", None)
    assert ur_speed.main([]) == 2
    assert "pip install ur-rtde" in capfd.readouterr().err
