"""The node against a fake receiver; RTDE itself is tested in test_rtde_protocol.py."""

import functools
import threading
import time

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from midastouch_common.clock_offset import ClockOffset
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns, transform_from_msg
from midastouch_motion.nodes import ur_tf
from midastouch_motion.nodes.ur_tf import UrTf
from midastouch_motion.ur.rtde import BASE_LINK_FROM_BASE, JOINT_NAMES, ArmState, transform_from_rtde

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("brisk_health")]
POSE = np.array([0.3, -0.2, 0.4, 0.1, np.pi - 0.5, -0.2])


class FakeArm:
    """Counts up its clock at each read unless it hangs, or shows a fault: is silent, has lost the connection (and does
    not close, where it is stuck), is failing."""

    def __init__(self):
        self.now, self.fault, self.closed, self.pose, self.free = 10.0, "", False, POSE, threading.Event()
        self.free.set()

    def read(self):
        self.free.wait()
        if self.fault == "failing":
            raise RuntimeError("unable to get state data for specified key: timestamp")
        if self.fault in ("lost", "stuck"):
            return None
        if self.fault != "silent":
            self.now += 0.008
        return ArmState(self.now, self.pose, np.arange(6.0), -np.arange(6.0), np.arange(6.0) + 1.0)

    def close(self):
        self.closed = True
        if self.fault == "stuck":
            raise OSError("bad file descriptor")


class Arms:
    """A `connect` that hands out one arm per attempt, once `heard` is set, and refuses while `refuse` is set."""

    def __init__(self):
        self.made, self.refuse, self.attempts, self.heard = [], False, 0, threading.Event()

    def __call__(self, robot_ip, rate):
        self.heard.wait()
        self.attempts += 1
        if self.refuse:
            raise ConnectionError(f"no RTDE at {robot_ip}: refused")
        self.made.append(FakeArm())
        return self.made[-1]


class Bench:
    """The node and what it says."""

    def __init__(self, graph, **parameters):
        self.graph, self.arms, self.until = graph, Arms(), graph.spin_until
        settings = {"robot_ip": "the.arm", "timeout": 0.2, "reconnect_period": 0.1, **parameters}
        self.node = graph.add(lambda **options: UrTf(self.arms, **options), settings)
        try:
            self.tf, self.joints = graph.listen(TFMessage, "/tf"), graph.listen(JointState, "joint_states")
            self.wrenches = graph.listen(WrenchStamped, "wrench")
            self.static = graph.listen(TFMessage, "/tf_static", latched=True)
            self.health = graph.health()
        finally:
            self.arms.heard.set()

    def sending(self):
        """Itself, once further transforms have come."""
        self.tf.clear()
        self.until(lambda: self.tf)
        return self


@pytest.fixture
def bench(graph):
    return functools.partial(Bench, graph)


def test_publishes_tool_base_joints_and_force(bench):
    b = bench(tf_prefix="left_", tcp_offset=[0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    b.until(lambda: b.tf and b.static and b.joints and b.wrenches)
    tool = b.tf[0].transforms[0]
    assert (tool.header.frame_id, tool.child_frame_id) == ("left_base", "left_tool0")
    expected = transform_from_rtde(POSE)
    expected[:3, 3] -= 0.1 * expected[:3, 2]
    np.testing.assert_allclose(transform_from_msg(tool.transform), expected, atol=1e-12)
    base = b.static[0].transforms[0]
    assert (base.header.frame_id, base.child_frame_id) == ("left_base_link", "left_base")
    np.testing.assert_allclose(transform_from_msg(base.transform), BASE_LINK_FROM_BASE, atol=1e-12)
    assert list(b.joints[0].name) == ["left_" + name for name in JOINT_NAMES]
    assert list(b.joints[0].position) == list(range(6))
    assert list(b.joints[0].velocity) == [-v for v in range(6)]
    felt = b.wrenches[0]
    assert (felt.header.frame_id, felt.header.stamp) == ("left_base", b.tf[0].transforms[0].header.stamp)
    force, torque = felt.wrench.force, felt.wrench.torque
    assert [force.x, force.y, force.z, torque.x, torque.y, torque.z] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_the_arm_is_never_put_back_unless_our_clock_is(bench, monkeypatch):
    base, ms = 1_000_000_000_000, 1_000_000
    monkeypatch.setattr(ur_tf.ClockOffset, "to_wall_ns", lambda _, monotonic_ns: monotonic_ns)
    told = iter([base, base - 50 * ms, base, base + 10 * ms, base - 2000 * ms, *range(base, base + 9000 * ms, ms)])
    monkeypatch.setattr(ur_tf.RobotClock, "stamp", lambda *_: next(told))
    b = bench()
    b.until(lambda: len(b.tf) >= 4)
    stamps = [stamp_ns(m.transforms[0].header.stamp) - base for m in b.tf[:4]]
    assert stamps == [0, 10 * ms, -2000 * ms, 0]


def test_a_step_of_our_clock_is_one_of_the_stamps_at_once(bench, monkeypatch):
    step = 3600 * 10**9
    ahead = [0]
    monkeypatch.setattr(ur_tf, "ClockOffset", lambda: ClockOffset(wall_ns=lambda: time.time_ns() + ahead[0]))
    b = bench()
    b.until(lambda: len(b.tf) > 5)
    ahead[0] = step
    b.until(lambda: stamp_ns(b.tf[-1].transforms[0].header.stamp) > time.time_ns() + step // 2)
    seen = len(b.tf)
    b.until(lambda: len(b.tf) > seen + 5)
    stamps = np.array([stamp_ns(m.transforms[0].header.stamp) for m in b.tf])
    before, after = stamps[stamps < time.time_ns() + step // 2], stamps[stamps >= time.time_ns() + step // 2]
    assert len(before) + len(after) == len(stamps)
    assert after[0] - before[-1] == pytest.approx(step, abs=60 * 10**9)


def test_a_call_that_hangs_is_told(bench):
    b = bench().sending()
    b.arms.made[0].free.clear()
    b.health.until("no sample for")
    b.arms.made[0].free.set()
    b.sending()


@pytest.mark.parametrize("fault", ["silent", "lost", "failing", "stuck"])
def test_connects_again_after(bench, fault):
    b = bench().sending()
    b.arms.made[0].fault = fault
    b.until(lambda: len(b.arms.made) > 1)
    assert b.arms.made[0].closed
    b.sending()


def test_keeps_trying_while_the_arm_is_off_and_says_so(bench):
    b = bench()
    b.health.until("connected")
    b.arms.refuse = True
    b.arms.made[-1].fault = "lost"
    b.until(lambda: b.arms.attempts >= 3 and b.health.says("refused"))
    b.arms.refuse = False
    b.sending()


def test_a_sample_that_is_not_finite_is_not_published(bench):
    b = bench().sending()
    b.arms.made[0].pose = np.full(6, np.nan)
    b.health.until("non-finite")
    b.arms.made[0].pose = POSE
    b.sending()
    poses = [transform_from_msg(t.transform) for message in b.tf for t in message.transforms]
    assert np.isfinite(poses).all()


@pytest.mark.parametrize(
    ("settings", "reason"),
    [({"use_sim_time": True, "robot_ip": "the.arm"}, "use_sim_time"), ({}, "parameter 'robot_ip' is empty")],
)
def test_refuses_simulated_time_and_an_arm_without_address(graph, settings, reason):
    arms = Arms()
    with pytest.raises(InputError, match=reason):
        graph.add(lambda **options: UrTf(arms, **options), settings)
    assert arms.attempts == 0


def test_destroying_the_node_ends_its_thread(graph, bench):
    b = bench().sending()
    graph.remove(b.node)
    assert not any(thread.name == "rtde" for thread in threading.enumerate())
    assert b.arms.made[0].closed
