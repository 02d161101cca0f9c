"""Which of the links of a tree of frames a source of transforms keeps, and whose time counts."""

from __future__ import annotations

import numpy as np
import pytest
from filter_fakes import SECOND, tf_msg, translation
from tf2_msgs.msg import TFMessage
from transform_rig import stamped

from midastouch_filter.transforms import PastExtrapolationError, TransformError
from midastouch_filter.transforms.queue import Wait

pytestmark = pytest.mark.dds


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


def test_the_newest_pose_of_another_frame_is_never_from_before_its_jump(tree):
    listening, send = tree
    for stamp in (1, 2, 0):
        send(stamp, ("map", "camera"), x=0.1 * stamp)
        np.testing.assert_allclose(listening.source.newest("map", "camera"), translation(0.1 * stamp))
    assert listening.jumps == []


def test_the_newest_pose_goes_through_every_link_at_its_newest(tree):
    listening, send = tree
    send(52, ("world", "base_link"), x=2.0)
    send(60, ("tool", "finger"), x=0.25)
    np.testing.assert_allclose(listening.source.newest("world", "finger"), translation(2.75))
    np.testing.assert_allclose(listening.source.newest("/finger", "base_link"), translation(-0.75))
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


def test_only_what_links_the_frames_is_kept_and_once(tree, monkeypatch):
    listening, send = tree
    kept = []
    insert = listening.buffer.insert
    monkeypatch.setattr(listening.buffer, "insert", lambda *what: kept.append(what[1:3]) or insert(*what))
    for stamp in (52, 53):
        send(stamp, ("world", "base_link"), ("base_link", "tool"), ("tool", "finger"), ("map", "camera"))
    assert kept == [("tool", 52 * SECOND), ("tool", 53 * SECOND)]


def test_a_frame_between_that_gets_another_parent_is_found_again(tree):
    """The tool goes from one arm to another, of which nothing was kept before."""
    listening, send = tree
    send(52, ("base_link", "other_arm"), x=0.2)
    for stamp in (53, 54):
        send(stamp, ("other_arm", "tool"), x=0.1)
        send(stamp, ("base_link", "other_arm"), x=0.2)
    np.testing.assert_allclose(listening.until(54 * SECOND), translation(0.3))
    with pytest.raises(PastExtrapolationError):
        listening.lookup(51 * SECOND)
