"""The stand-in for tf2_ros on the wheels; its answers are in midastouch_common/test/transforms/test_buffer_facts.py."""

from __future__ import annotations

import contextlib
import queue
import struct
import threading

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rclpy.time import Time
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from tf2_ros import Buffer, ExtrapolationException, TransformListener, transform_listener
from tf_messages import tf_msg, translation

from midastouch_common import se3
from midastouch_common.message_arrays import SECOND, stamp_ns, xyzquat_from_msg
from midastouch_common.ros import qos
from midastouch_common.transforms import rigid
from midastouch_tools.bags.transforms import RecordedTransforms

if not hasattr(transform_listener, "transforms_of"):
    pytest.skip("a system ROS has the real tf2_ros", allow_module_level=True)

FRAMES = "base_link", "digit_gel_frame"
names = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)
numbers = st.lists(st.floats(allow_nan=False), min_size=7, max_size=7)
transforms = st.tuples(names, names, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1), numbers)


def stamped(parent, child, sec, nanosec, pose) -> TransformStamped:
    item = TransformStamped(child_frame_id=child)
    item.header.frame_id, item.header.stamp.sec, item.header.stamp.nanosec = parent, sec, nanosec
    p, q = item.transform.translation, item.transform.rotation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose
    return item


def test_a_recording_answers_as_the_buffer_does_and_further_back():
    """Random poses of a chain with a static link and a branch, at any stamp between."""
    rng = np.random.default_rng(3)
    recorded, live = RecordedTransforms(), Buffer()
    poses = se3.to_xyzquat(se3.make(se3.random_rotations(61, rng), rng.uniform(-1, 1, (61, 3)))).tolist()
    links = [("base", "tool", False, i) for i in range(30)] + [("base", "camera", False, i) for i in range(30)]
    for (parent, child, static, i), pose in zip([*links, ("tool", "gel", True, 0)], poses, strict=True):
        stamp = (100 + i) * SECOND
        assert recorded.insert(parent, child, stamp, pose, static)
        (live.set_transform_static if static else live.set_transform)(stamped(parent, child, 100 + i, 0, pose), "test")
    for stamp in rng.integers(119 * SECOND, 129 * SECOND, 50).tolist():
        for ends in (("base", "gel"), ("camera", "gel"), ("gel", "base"), ("gel", "gel")):
            found = live.lookup_transform(*ends, Time(nanoseconds=stamp)).transform
            np.testing.assert_array_equal(recorded.lookup(*ends, stamp), rigid.to_matrix(xyzquat_from_msg(found)))
    np.testing.assert_allclose(recorded.lookup("base", "tool", 100 * SECOND), se3.from_xyzquat(poses[0]), atol=1e-9)


def serialised(content) -> bytes:
    return serialize_message(TFMessage(transforms=[stamped(*item) for item in content]))


def big_endian(content) -> bytes:
    out = struct.pack(">BBHI", 0, 0, 0, len(content))
    for parent, child, sec, nanosec, pose in content:
        out += struct.pack(">iI", sec, nanosec)
        for name in (parent, child):
            out += b"\0" * (-len(out) % 4)
            out += struct.pack(">I", len(name.encode()) + 1) + name.encode() + b"\0"
        out += b"\0" * (-(len(out) - 4) % 8) + struct.pack(">7d", *pose)
    return out


@pytest.mark.parametrize("write", [serialised, big_endian])
@given(content=st.lists(transforms, max_size=5))
def test_every_transform_is_read_as_it_was_written(write, content):
    read = [
        (t.header.frame_id, t.child_frame_id, stamp_ns(t.header.stamp), xyzquat_from_msg(t.transform))
        for t in transform_listener.transforms_of(write(content))
    ]
    assert read == [
        (parent, child, sec * SECOND + nanosec, tuple(pose)) for parent, child, sec, nanosec, pose in content
    ]


def test_filling_and_asking_from_two_threads():
    buffer, done = Buffer(), []
    message = tf_msg(SECOND, translation(0.0)).transforms[0]
    buffer.set_transform(message, "test")

    def ask():
        for _ in range(2000):
            # the writer may have outrun this reader's history between the two calls
            with contextlib.suppress(ExtrapolationException):
                buffer.lookup_transform(*FRAMES, buffer.get_latest_common_time(*FRAMES))
        done.append(True)

    reader = threading.Thread(target=ask)
    reader.start()
    for seconds in range(2, 5000):
        message.header.stamp.sec = seconds
        buffer.set_transform(message, "test")
    reader.join()
    assert done, "an error ended the reader"


class Told(Buffer):
    """A buffer that tells of each transform."""

    def __init__(self):
        super().__init__()
        self.seconds = queue.Queue()

    def set_transform(self, transform, authority):
        super().set_transform(transform, authority)
        self.seconds.put(transform.header.stamp.sec)


@pytest.fixture
def listening(graph, monkeypatch):
    """A buffer, and a publisher to its listener, which never looks by itself."""
    monkeypatch.setattr(transform_listener, "LOOK_UP_NS", int(100e9))
    buffer, threads = Told(), threading.active_count()
    listener = TransformListener(buffer, graph.companion, qos=qos.TF_SUBSCRIBER)
    publisher = graph.companion.create_publisher(TFMessage, "/tf", qos.TF)
    graph.spin_until(lambda: publisher.get_subscription_count() > 0)
    yield buffer, publisher
    listener.unregister()
    assert threading.active_count() == threads
    assert graph.companion.count_subscribers("/tf") == 0


@pytest.mark.dds
def test_transforms_come_at_once_while_the_executor_is_busy(graph, listening):
    buffer, publisher = listening
    graph.companion.create_subscription(String, "busy", lambda message: None, 10)
    other = graph.companion.create_publisher(String, "busy", 10)
    missed = []

    def one_after_the_other() -> None:
        for number in range(1, 1500):
            publisher.publish(tf_msg(number * SECOND, translation(0.0)))
            other.publish(String())
            try:
                buffer.seconds.get(timeout=30.0)
            except queue.Empty:
                missed.append(number)
                return

    sender = threading.Thread(target=one_after_the_other)
    sender.start()
    while sender.is_alive():
        graph.spin_for(0.02)
    assert missed == []


@pytest.mark.dds
def test_a_broken_message_is_logged_and_harms_no_other(listening, capfd):
    buffer, publisher = listening
    publisher.publish(serialize_message(tf_msg(SECOND, translation(0.1)))[:40])
    publisher.publish(tf_msg(2 * SECOND, translation(0.1)))
    assert buffer.seconds.get(timeout=30.0) == 2
    assert "/tf: Traceback" in capfd.readouterr().err


@pytest.mark.dds
@pytest.mark.usefixtures("listening")
def test_a_publisher_that_cannot_be_heard_is_reported(graph, capfd):
    unreliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    graph.companion.create_publisher(TFMessage, "/tf", unreliable)
    said = []
    graph.spin_until(lambda: said.append(capfd.readouterr().err) or "incompatible QoS" in "".join(said))
