"""What a sequence is as messages."""

import dataclasses
import itertools

import pytest
from recorded import SECOND, STORE, write
from rosbags.highlevel import AnyReader

from midastouch_common.frames import GEL_FRAME
from midastouch_tools.bags.messages import Message, header, header_stamp_ns, sequence_messages


def test_messages_come_in_order_of_time_and_end_with_the_image(simulated_sequence):
    messages = list(sequence_messages(simulated_sequence(n=4)))
    assert [m.topic for m in messages] == ["/tf_static"] + ["/tf", "/camera_info", "/image_raw"] * 4
    assert all(a.stamp_ns <= b.stamp_ns for a, b in itertools.pairwise(messages))
    assert [m.latched for m in messages] == [True] + [False] * 12
    assert header_stamp_ns(messages[-1].data) == messages[-1].stamp_ns


def test_header_stamp_of_both_byte_orders():
    for flag, order in ((1, "little"), (0, "big")):
        data = bytes([0, flag, 0, 0]) + (7).to_bytes(4, order) + (5).to_bytes(4, order)
        assert header_stamp_ns(data) == 7 * SECOND + 5


def test_custom_messages_are_known(tmp_path):
    kind = "midastouch_msgs/msg/FilterStatus"
    fields = {f.name: f.default for f in dataclasses.fields(STORE.types[kind])}
    assert {"state", "reason", "ess", "skipped_counts"} <= fields.keys()
    assert STORE.types[kind].STATE_CONVERGED == "converged"
    content = STORE.types["midastouch_msgs/msg/TactileContact"](header(SECOND, GEL_FRAME), True, "contact", 2e-5, 1e-3)
    path = write(tmp_path / "x.mcap", Message.of("/tactile/contact", content, SECOND))
    with AnyReader([path]) as reader:
        (connection,) = reader.connections
        (_, _, stored) = next(reader.messages())
        contact = reader.deserialize(stored, connection.msgtype)
        assert (contact.area, contact.depth) == (pytest.approx(2e-5), pytest.approx(1e-3))
