from __future__ import annotations

import math
import types

import numpy as np
import pytest
from filter_fakes import SECOND, FakeTf2, tf_msg, translation
from tf2_msgs.msg import TFMessage

from midastouch_filter.nodes import transform_buffers
from midastouch_filter.nodes.transform_buffers import OwnBuffer, Tf2Buffer
from midastouch_filter.nodes.transform_source import TransformSource, Wait
from midastouch_filter.transforms import (
    DisconnectedError,
    FutureExtrapolationError,
    Insertion,
    InvalidTransformError,
    PastExtrapolationError,
    TransformError,
    UnknownFrameError,
)
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos

FRAMES = "base_link", "digit_gel_frame"


def stamped(stamp: int, x: float, parent: str = "base_link", child: str = "digit_gel_frame"):
    return tf_msg(stamp, translation(x), parent, child).transforms[0]


@pytest.fixture(params=["own", "tf2"])
def buffer(request, monkeypatch):
    if request.param == "own":
        return OwnBuffer()
    monkeypatch.setattr(transform_buffers, "tf2_ros", FakeTf2)
    return Tf2Buffer()


def test_both_buffers_tell_the_same_errors_apart(buffer):
    with pytest.raises(UnknownFrameError):
        buffer.lookup("base_link", "digit_gel_frame", SECOND)
    assert buffer.insert(stamped(1 * SECOND, 0.1)) is Insertion.ADDED
    assert buffer.insert(stamped(2 * SECOND, 0.2)) is Insertion.ADDED
    buffer.insert_static(stamped(0, 0.5, "c", "d"))
    np.testing.assert_allclose(buffer.lookup("base_link", "digit_gel_frame", 2 * SECOND), translation(0.2))
    np.testing.assert_allclose(buffer.lookup("base_link", "digit_gel_frame", None), translation(0.2))
    with pytest.raises(FutureExtrapolationError):
        buffer.lookup("base_link", "digit_gel_frame", 3 * SECOND)
    with pytest.raises(PastExtrapolationError):
        buffer.lookup("base_link", "digit_gel_frame", SECOND // 2)
    with pytest.raises(DisconnectedError):
        buffer.lookup("base_link", "d", SECOND)


def test_both_buffers_take_any_frame_name(buffer):
    buffer.insert(stamped(1 * SECOND, 0.1))
    np.testing.assert_allclose(buffer.lookup("/base_link", "/digit_gel_frame", SECOND), translation(0.1))
    for name in ("", "/"):
        with pytest.raises(TransformError):
            buffer.lookup("base_link", name, None)


def test_both_buffers_see_time_run_backwards(buffer):
    buffer.insert(stamped(100 * SECOND, 0.1))
    buffer.insert_static(stamped(0, 0.5, "c", "d"))
    assert buffer.insert(stamped(1 * SECOND, 0.2)) is Insertion.TIME_JUMP
    buffer.clear()
    assert buffer.insert(stamped(1 * SECOND, 0.2)) is Insertion.ADDED
    with pytest.raises(FutureExtrapolationError):
        buffer.lookup("base_link", "digit_gel_frame", 100 * SECOND)
    np.testing.assert_allclose(buffer.lookup("c", "d", SECOND), translation(0.5))
    assert buffer.insert(stamped(2 * SECOND, 0.2)) is Insertion.ADDED


def test_both_buffers_refuse_what_is_not_finite_before_they_look_at_its_time(buffer):
    buffer.insert(stamped(100 * SECOND, 0.1))
    with pytest.raises((InputError, InvalidTransformError)):
        buffer.insert(stamped(1 * SECOND, math.nan))
    assert buffer.insert(stamped(101 * SECOND, 0.1)) is Insertion.ADDED


def test_tf2_never_takes_a_stamp_for_the_newest_one(monkeypatch):
    """To tf2, 0 means the newest transform, and a negative time is an error of its own."""
    monkeypatch.setattr(transform_buffers, "tf2_ros", FakeTf2)
    buffer = Tf2Buffer()
    buffer.insert(stamped(SECOND, 0.1))
    for stamp in (0, -SECOND):
        with pytest.raises(PastExtrapolationError, match="epoch"):
            buffer.lookup("base_link", "digit_gel_frame", stamp)


def test_tf2_without_a_common_time_has_no_newest_transform(monkeypatch):
    def fail(*_):
        raise FakeTf2.ExtrapolationException("the histories do not overlap")

    monkeypatch.setattr(transform_buffers, "tf2_ros", FakeTf2)
    buffer = Tf2Buffer()
    buffer.insert(stamped(SECOND, 0.1))
    monkeypatch.setattr(FakeTf2.Buffer, "lookup_transform_core", fail)
    with pytest.raises(PastExtrapolationError, match="overlap"):
        buffer.lookup("base_link", "digit_gel_frame", None)


def test_tf2_is_used_where_it_is_installed(monkeypatch):
    node = types.SimpleNamespace(create_subscription=lambda *_: None)
    monkeypatch.setattr(transform_buffers, "tf2_ros", FakeTf2)
    source = TransformSource(node, FRAMES, *[lambda *_: None] * 3)
    assert isinstance(source._buffer, Tf2Buffer)


class Listening:
    """A source on the graph, with what it reported."""

    def __init__(self, graph):
        self.updates, self.jumps, self.bad = 0, 0, []
        self.source = TransformSource(graph.companion, FRAMES, self._update, self._jump, self.bad.append)

    def _update(self):
        self.updates += 1

    def _jump(self):
        self.jumps += 1

    def lookup(self, stamp):
        return self.source.lookup("base_link", "digit_gel_frame", stamp)


@pytest.mark.dds
def test_source_waits_interpolates_and_reports(graph):
    listening = Listening(graph)
    assert isinstance(listening.lookup(SECOND), Wait)
    tf = graph.publisher(TFMessage, "/tf")
    tf.publish(tf_msg(1 * SECOND, translation(0.1)))
    graph.spin_until(lambda: listening.updates == 1)
    assert isinstance(listening.lookup(3 * SECOND // 2), Wait)
    tf.publish(tf_msg(2 * SECOND, translation(0.3)))
    graph.spin_until(lambda: listening.updates == 2)
    np.testing.assert_allclose(listening.lookup(3 * SECOND // 2), translation(0.2), atol=1e-12)
    with pytest.raises(PastExtrapolationError):
        listening.lookup(SECOND // 2)

    broken = tf_msg(3 * SECOND, translation(0.4))
    broken.transforms[0].transform.rotation.w = 0.0
    tf.publish(broken)
    graph.spin_until(lambda: listening.updates == 3)
    assert len(listening.bad) == 1
    assert "/tf" in listening.bad[0]
    assert listening.jumps == 0


@pytest.mark.dds
def test_source_reports_a_jump_and_can_be_rewound(graph):
    listening = Listening(graph)
    tf = graph.publisher(TFMessage, "/tf")
    for stamp in (50, 51):
        tf.publish(tf_msg(stamp * SECOND, translation(0.1)))
    graph.spin_until(lambda: listening.updates == 2)
    tf.publish(tf_msg(1 * SECOND, translation(0.2)))
    graph.spin_until(lambda: listening.updates == 3)
    assert listening.jumps == 1
    np.testing.assert_allclose(listening.lookup(SECOND), translation(0.2))

    listening.source.rewind(1 * SECOND)
    assert not isinstance(listening.lookup(SECOND), Wait), "these transforms come from after the jump"
    listening.source.rewind(-10 * SECOND)
    assert isinstance(listening.lookup(SECOND), Wait)


@pytest.fixture(params=["own", "tf2"])
def tree(request, graph, monkeypatch):
    """A source, and a publisher that feeds it world -> base_link -> tool -> digit_gel_frame and what hangs on these."""
    if request.param == "tf2":
        monkeypatch.setattr(transform_buffers, "tf2_ros", FakeTf2)
    listening = Listening(graph)
    tf, static = graph.publisher(TFMessage, "/tf"), graph.publisher(TFMessage, "/tf_static", latched=True)
    static.publish(tf_msg(0, translation(0.0), "tool", "digit_gel_frame"))
    graph.spin_until(lambda: listening.updates == 1)
    sent = []

    def send(stamp: int, *edges: tuple[str, str], x: float = 0.5) -> None:
        sent.append(TFMessage(transforms=[stamped(stamp * SECOND, x, *edge) for edge in edges]))
        tf.publish(sent[-1])
        graph.spin_until(lambda: listening.updates == 1 + len(sent))

    for stamp in (50, 51):
        send(stamp, ("world", "base_link"), ("base_link", "tool"), ("tool", "finger"), ("map", "camera"))
    return listening, send


@pytest.mark.dds
@pytest.mark.parametrize("edge", [("world", "base_link"), ("tool", "finger"), ("map", "camera"), ("map", "new")])
def test_the_time_of_other_frames_is_their_own(tree, edge):
    listening, send = tree
    for stamp in (1, 2000, 1):
        send(stamp, edge)
    assert listening.jumps == 0
    assert not isinstance(listening.source.lookup("base_link", "tool", 51 * SECOND), Wait)
    listening.source.rewind(51 * SECOND)  # these are not from before a jump: their newest is of 51 s
    assert not isinstance(listening.source.lookup("base_link", "tool", 51 * SECOND), Wait)


@pytest.mark.dds
def test_the_newest_pose_of_another_frame_is_never_from_before_its_jump(tree):
    listening, send = tree
    for stamp in (1, 2):
        send(stamp, ("map", "camera"), x=0.1 * stamp)
        np.testing.assert_allclose(listening.source.lookup("map", "camera", None), translation(0.1 * stamp))
    assert listening.jumps == 0


@pytest.mark.dds
def test_the_time_of_any_frame_in_between_is_the_recordings(tree):
    listening, send = tree
    send(1, ("tool", "finger"), ("base_link", "tool"), ("map", "camera"))
    assert listening.jumps == 1
    assert isinstance(listening.source.lookup("base_link", "tool", 51 * SECOND), Wait)
    assert not isinstance(listening.source.lookup("base_link", "tool", 1 * SECOND), Wait)
    assert isinstance(listening.source.lookup("world", "base_link", 51 * SECOND), Wait)


@pytest.mark.dds
def test_static_transforms_come_late_and_hold_always(graph):
    latched = graph.companion.create_publisher(TFMessage, "/tf_static", qos.latched(10))
    latched.publish(tf_msg(0, translation(0.7)))
    listening = Listening(graph)
    graph.spin_until(lambda: listening.updates == 1)
    np.testing.assert_allclose(listening.lookup(123 * SECOND), translation(0.7))
