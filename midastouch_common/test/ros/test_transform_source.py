from __future__ import annotations

import math
import threading

import numpy as np
import pytest
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg, translation
from transform_rig import FRAMES, Listening, stamped

from midastouch_common.message_arrays import SECOND
from midastouch_common.ros import qos
from midastouch_common.transforms.queue import Wait
from midastouch_common.transforms.rigid import TransformError

pytestmark = pytest.mark.dds


def test_source_waits_interpolates_and_reports(listening):
    assert isinstance(listening.lookup(SECOND), Wait)
    listening.send(stamped(1 * SECOND, 0.1))
    np.testing.assert_allclose(listening.until(SECOND), translation(0.1))
    assert isinstance(listening.lookup(3 * SECOND // 2), Wait)
    listening.send(stamped(2 * SECOND, 0.3))
    np.testing.assert_allclose(listening.until(3 * SECOND // 2), translation(0.2), atol=1e-12)
    for stamp in (SECOND // 2, 0, -SECOND):
        with pytest.raises(TransformError, match="history starts"):
            listening.lookup(stamp)
    assert listening.jumps == listening.bad == []


@pytest.mark.parametrize(
    "spoil",
    [
        lambda t: setattr(t.transform.rotation, "w", 0.0),
        lambda t: setattr(t.transform.translation, "x", math.nan),
        lambda t: setattr(t, "child_frame_id", "base_link"),
        lambda t: setattr(t.header, "frame_id", ""),
        lambda t: (setattr(t.header, "frame_id", "digit_gel_frame"), setattr(t, "child_frame_id", "base_link")),
    ],
)
def test_a_bad_transform_is_reported_and_harms_no_other(listening, spoil):
    listening.send(stamped(1 * SECOND, 0.1))
    broken = stamped(2 * SECOND, 0.4)
    spoil(broken)
    listening.send(broken, stamped(3 * SECOND, 0.3))
    listening.graph.spin_until(lambda: listening.bad, "the report")
    assert len(listening.bad) == 1
    assert listening.bad[0].startswith("/tf: ")
    np.testing.assert_allclose(listening.lookup(2 * SECOND), translation(0.2), atol=1e-12)
    assert listening.jumps == []


def test_what_is_waited_for_is_reported_once_and_nothing_else(listening):
    listening.send(stamped(1 * SECOND, 0.1))
    assert listening.updates == 0
    assert isinstance(listening.lookup(5 * SECOND), Wait)
    for stamp in (2, 3, 4):
        listening.send(stamped(stamp * SECOND, 0.1))
    assert listening.updates == 0
    listening.send(stamped(5 * SECOND, 0.1))
    listening.graph.spin_until(lambda: listening.updates, "the transform")
    for stamp in (6, 7):
        listening.send(stamped(stamp * SECOND, 0.1))
    assert listening.updates == 1


def test_source_reports_a_jump_and_can_be_rewound(listening):
    listening.send(stamped(50 * SECOND, 0.1))
    listening.send(stamped(51 * SECOND, 0.1))
    listening.send(stamped(1 * SECOND, 0.2))
    listening.graph.spin_until(lambda: listening.jumps, "the jump")
    assert listening.jumps == [1 * SECOND]
    np.testing.assert_allclose(listening.lookup(SECOND), translation(0.2))

    listening.source.rewind(1 * SECOND)
    assert not isinstance(listening.lookup(SECOND), Wait), "these transforms come from after the jump"
    listening.source.rewind(-10 * SECOND)
    assert isinstance(listening.lookup(SECOND), Wait)


def test_a_jump_is_reported_before_later_answers(listening):
    """Nothing spins between the jump and the question: the node's own thread is in a timer of its."""
    listening.send(stamped(50 * SECOND, 0.1))
    listening.tf.publish(TFMessage(transforms=[stamped(1 * SECOND, 0.2)]))
    listening.wait_unspun(lambda: isinstance(listening.lookup(50 * SECOND), Wait))
    assert listening.jumps == []
    assert isinstance(listening.lookup(1 * SECOND), Wait)
    with pytest.raises(TransformError):
        listening.source.latest_stamp(*FRAMES)
    listening.graph.spin_until(lambda: listening.jumps, "the jump")
    assert listening.source.latest_stamp(*FRAMES) == 1 * SECOND
    np.testing.assert_allclose(listening.lookup(SECOND), translation(0.2))


def test_asking_right_after_a_jump_is_never_fatal(listening):
    """Where the real tf2 raises the base of its exceptions."""
    listening.send(stamped(50 * SECOND, 0.1))
    listening.source.rewind(1 * SECOND)
    for stamp in (1 * SECOND, 50 * SECOND, 99 * SECOND):
        assert isinstance(listening.lookup(stamp), Wait)
    with pytest.raises(TransformError):
        listening.source.newest(*FRAMES)


def test_late_static_transforms_find_the_moving_ones_history(listening):
    for stamp in (1, 2):
        listening.send(stamped(stamp * SECOND, 0.1 * stamp, "base_link", "tool"))
    assert isinstance(listening.lookup(3 * SECOND // 2), Wait)
    static = listening.graph.publisher(TFMessage, "/tf_static", latched=True)
    static.publish(tf_msg(0, translation(0.7), "tool", "digit_gel_frame"))
    np.testing.assert_allclose(listening.until(3 * SECOND // 2), translation(0.85), atol=1e-12)


def test_static_transforms_hold_always(graph):
    latched = graph.companion.create_publisher(TFMessage, "/tf_static", qos.latched(10))
    latched.publish(tf_msg(0, translation(0.7)))
    listening = Listening(graph)
    np.testing.assert_allclose(listening.until(123 * SECOND), translation(0.7))
    listening.source.close()


def test_transforms_are_read_while_the_executor_is_busy(listening):
    """Nothing spins here: the node's own thread is in a step of the filter."""
    listening.tf.publish(tf_msg(SECOND, translation(0.1)))
    listening.wait_unspun(lambda: not isinstance(listening.lookup(SECOND), Wait))


def test_after_closing_nothing_is_heard(listening):
    threads = threading.active_count()
    listening.source.close()
    assert threading.active_count() == threads - 1
    assert listening.graph.companion.count_subscribers("/tf") == 0
    assert isinstance(listening.lookup(SECOND), Wait)


@pytest.fixture
def tree(listening):
    """A source that was sent world -> base_link -> tool -> digit_gel_frame and what hangs on these."""
    static = listening.graph.publisher(TFMessage, "/tf_static", latched=True)
    static.publish(tf_msg(0, translation(0.0), "tool", "digit_gel_frame"))

    def send(stamp: int, *edges: tuple[str, str], x: float = 0.5) -> None:
        listening.send(*(stamped(stamp * SECOND, x, *edge) for edge in edges))

    for stamp in (50, 51):
        send(stamp, ("world", "base_link"), ("base_link", "tool"), ("tool", "finger"), ("map", "camera"))
    np.testing.assert_allclose(listening.until(51 * SECOND), translation(0.5))
    return listening, send


@pytest.mark.parametrize("edge", [("world", "base_link"), ("tool", "finger"), ("map", "camera"), ("map", "new")])
def test_the_time_of_other_frames_is_their_own(tree, edge):
    listening, send = tree
    for stamp in (1, 2000, 1):
        send(stamp, edge)
    assert listening.jumps == []
    assert not isinstance(listening.lookup(51 * SECOND), Wait)
    listening.source.rewind(51 * SECOND)  # these are not from before a jump: their newest is of 51 s
    assert not isinstance(listening.lookup(51 * SECOND), Wait)


def test_the_newest_pose_is_of_the_newest_common_stamp(tree):
    listening, send = tree
    send(52, ("world", "base_link"), x=2.0)
    send(60, ("tool", "finger"), x=0.25)
    np.testing.assert_allclose(listening.source.newest("world", "base_link"), translation(2.0))
    np.testing.assert_allclose(listening.source.newest("/tool", "finger"), translation(0.25))
    np.testing.assert_allclose(listening.source.newest("world", "finger"), translation(0.5 + 0.5 + 0.5))
    for other in ("cup", "map"):
        with pytest.raises(TransformError, match=other):
            listening.source.newest("world", other)


def test_the_time_of_any_frame_in_between_is_the_recordings(tree):
    listening, send = tree
    send(1, ("tool", "finger"), ("base_link", "tool"), ("map", "camera"))
    listening.graph.spin_until(lambda: listening.jumps, "the jump")
    assert listening.jumps == [1 * SECOND]
    assert isinstance(listening.lookup(51 * SECOND), Wait)
    assert not isinstance(listening.lookup(1 * SECOND), Wait)


def test_a_frame_between_that_gets_another_parent_is_found_again(tree):
    """The tool goes from one arm to another."""
    listening, send = tree
    send(52, ("base_link", "other_arm"), x=0.2)
    for stamp in (53, 54):
        send(stamp, ("other_arm", "tool"), x=0.1)
        send(stamp, ("base_link", "other_arm"), x=0.2)
    np.testing.assert_allclose(listening.until(54 * SECOND), translation(0.3))
    np.testing.assert_allclose(listening.lookup(51 * SECOND), translation(0.5))


def test_a_bad_link_on_a_new_way_keeps_no_other_from_it(tree):
    """Two frames between the arms' tools, of one of which the last transform before was no transform."""
    listening, send = tree
    send(51, ("base_link", "other_arm"), ("other_arm", "other_flange"), x=0.2)
    send(52, ("base_link", "other_arm"), x=math.nan)
    for stamp in (53, 54):
        send(stamp, ("other_flange", "tool"), x=0.1)
        send(stamp, ("base_link", "other_arm"), x=0.3)
        send(stamp, ("other_arm", "other_flange"), x=0.2)
    np.testing.assert_allclose(listening.until(54 * SECOND), translation(0.6))
