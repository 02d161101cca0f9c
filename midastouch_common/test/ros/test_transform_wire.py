"""Reading TFMessage from bytes, against rclpy's own serialisation."""

from __future__ import annotations

import struct

import pytest
from geometry_msgs.msg import TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from tf2_msgs.msg import TFMessage

from midastouch_common.errors import InputError
from midastouch_common.transforms.wire import WireTransforms, frame_name

names = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)
numbers = st.lists(st.floats(allow_nan=False), min_size=7, max_size=7)
transforms = st.tuples(names, names, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1), numbers)


def serialised(content) -> bytes:
    msg = TFMessage()
    for parent, child, sec, nanosec, pose in content:
        item = TransformStamped(child_frame_id=child)
        item.header.frame_id, item.header.stamp.sec, item.header.stamp.nanosec = parent, sec, nanosec
        p, q = item.transform.translation, item.transform.rotation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose
        msg.transforms.append(item)
    return serialize_message(msg)


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
    wire = WireTransforms(write(content))
    read = [(frame_name(parent), frame_name(child), stamp, wire.pose(at)) for parent, child, stamp, at in wire]
    assert read == [
        (parent.lstrip("/"), child.lstrip("/"), sec * 1_000_000_000 + nanosec, tuple(pose))
        for parent, child, sec, nanosec, pose in content
    ]


@given(content=st.lists(transforms, min_size=1, max_size=3), data=st.data())
def test_a_message_that_is_cut_short_says_so(content, data):
    whole = serialised(content)
    cut = whole[: data.draw(st.integers(0, len(whole) - 8))]
    with pytest.raises(InputError, match=r"cut short|not CDR"):
        list(WireTransforms(cut))


@given(message=st.binary(max_size=300), order=st.sampled_from([b"\0\0\0\0", b"\0\1\0\0", b""]))
def test_any_bytes_are_read_or_refused(message, order):
    try:
        wire = WireTransforms(order + message)
        for parent, child, _, at in wire:
            frame_name(parent), frame_name(child), wire.pose(at)
    except InputError:
        pass


def test_another_encapsulation_is_refused():
    with pytest.raises(InputError, match="0006"):
        WireTransforms(b"\0\6\0\0\0\0\0\0")
