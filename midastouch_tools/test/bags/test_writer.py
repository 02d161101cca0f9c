"""What goes in can be read by others, and a failure leaves nothing behind."""

import os

import mcap.reader
import numpy as np
import pytest
from recorded import SECOND, STILL, tf, write
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.frames import GEL_FRAME
from midastouch_tools.bags.reader import bag_messages, bag_metadata
from midastouch_tools.bags.writer import BagWriter, write_bag


def test_rosbags_reads_it_with_types_and_offered_qos(tmp_path, simulated_sequence):
    path = tmp_path / "slide"
    write_bag(simulated_sequence(n=3), path)
    with AnyReader([path]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        assert counts == {"/tf_static": 1, "/tf": 3, "/camera_info": 3, "/image_raw": 3}
        durability = {c.topic: c.ext.offered_qos_profiles[0].durability for c in reader.connections}
        assert durability["/tf_static"] is QosDurability.TRANSIENT_LOCAL
        assert durability["/image_raw"] is QosDurability.VOLATILE
        messages = {c.topic: reader.deserialize(data, c.msgtype) for c, _, data in reader.messages()}
    camera = messages["/camera_info"]
    assert (camera.width, camera.height, camera.k[0]) == (240, 320, 0.0)
    assert camera.header.stamp == messages["/image_raw"].header.stamp
    assert camera.header.frame_id == "digit_optical_frame"
    optical = messages["/tf_static"].transforms[0]
    assert (optical.header.frame_id, optical.child_frame_id) == (GEL_FRAME, "digit_optical_frame")
    assert optical.transform.translation.z == 0.022
    rotation = optical.transform.rotation
    looking = se3.from_xyzquat(np.array([0, 0, 0, rotation.x, rotation.y, rotation.z, rotation.w]))[:3, 2]
    np.testing.assert_allclose(looking, [0, 0, -1], atol=1e-12)  # at the object


def test_a_changed_byte_of_messages_or_summary_is_noticed(tmp_path):
    path = write(tmp_path / "x.mcap", *(tf(SECOND + i, STILL) for i in range(3)))
    with path.open("rb") as stream:
        summary = mcap.reader.make_reader(stream).get_summary()
        stream.seek(-28, os.SEEK_END)
        start = int.from_bytes(stream.read(8), "little")
    whole, (chunk,) = path.read_bytes(), summary.chunk_indexes
    with path.open("rb") as stream:
        read = mcap.reader.NonSeekingReader(stream, validate_crcs=True).iter_messages()
        assert [message.log_time for _, _, message in read] == [SECOND, SECOND + 1, SECOND + 2]
    for at in (chunk.chunk_start_offset + 33, whole.index(b"/tf", start), len(whole) - 9):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(InputError, match=r"x\.mcap: cannot be read as a bag \(.*(checksum|damaged)"):
            list(bag_messages(path))


def test_it_keeps_the_texts_of_its_end(tmp_path):
    with BagWriter(path := tmp_path / "x.mcap", {"object": "mug"}) as bag:
        bag.write(tf(SECOND, STILL))
        bag.metadata["object"] = ""  # in the meantime the arm has got another object
    assert bag_metadata(path) == {"object": ""}


def test_a_failure_leaves_nothing_behind(tmp_path):
    def fail():
        with BagWriter(tmp_path / "bags" / "x.mcap") as bag:
            bag.write(tf(SECOND, STILL))
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        fail()
    assert list((tmp_path / "bags").iterdir()) == []


def test_what_exists_is_refused_at_the_beginning_and_kept(tmp_path):
    write(tmp_path / "run.mcap", tf(SECOND, STILL))
    write(tmp_path / "bag", tf(SECOND, STILL))
    (tmp_path / "latest").symlink_to("nowhere")
    (tmp_path / "thesis.txt").write_text("precious")
    for name in ("run.mcap", "bag", "latest", "thesis.txt"):
        with pytest.raises(InputError, match=rf"{name}: exists already; name another bag"):
            BagWriter(tmp_path / name)
    assert len([*bag_messages(tmp_path / "run.mcap"), *bag_messages(tmp_path / "bag")]) == 2


def test_an_unwritable_path_is_named_as_it_was_given():
    with pytest.raises(OSError, match=r"x\.mcap") as caught, BagWriter("/proc/x.mcap"):
        pass
    assert caught.value.filename == "/proc/x.mcap"
