"""Bags: what goes in comes out, bad ones are refused in words, and a failure leaves nothing behind."""

import dataclasses
import itertools
import shutil

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from midastouch_bringup.bags import BagWriter, bag_messages, bag_metadata, is_bag, read_bag, write_bag
from midastouch_bringup.messages import (
    BASE_FRAME,
    BASE_FROM_OBJECT,
    GEL_FRAME,
    Message,
    header_stamp_ns,
    sequence_messages,
    typestore,
)
from midastouch_perception import se3
from midastouch_perception.errors import InputError

SECOND, MS = 1_000_000_000, 1_000_000
STORE = typestore()


def header(stamp_ns, frame):
    time = STORE.types["builtin_interfaces/msg/Time"](sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
    return STORE.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def tf(stamp_ns, row, parent=BASE_FRAME, child=GEL_FRAME, recorded_ns=None, topic="/tf"):
    """A transform message whose pose is a row [x y z qx qy qz qw]."""
    transform = STORE.types["geometry_msgs/msg/Transform"](
        STORE.types["geometry_msgs/msg/Vector3"](*row[:3]),
        STORE.types["geometry_msgs/msg/Quaternion"](*row[3:]),
    )
    stamped = STORE.types["geometry_msgs/msg/TransformStamped"](header(stamp_ns, parent), child, transform)
    content = STORE.types["tf2_msgs/msg/TFMessage"]([stamped])
    data = bytes(STORE.serialize_cdr(content, content.__msgtype__))
    return Message(topic, content.__msgtype__, recorded_ns or stamp_ns, data)


def image(stamp_ns, pixels=None, encoding="rgb8", recorded_ns=None, step=None, topic="/image_raw"):
    pixels = np.zeros((320, 240, 3), np.uint8) if pixels is None else pixels
    content = STORE.types["sensor_msgs/msg/Image"](
        header=header(stamp_ns, "digit_optical_frame"),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=step or pixels[0].size,
        data=pixels.reshape(-1),
    )
    data = bytes(STORE.serialize_cdr(content, content.__msgtype__))
    return Message(topic, content.__msgtype__, recorded_ns or stamp_ns, data)


def write(path, *messages):
    with BagWriter(path) as bag:
        for message in messages:
            bag.write(message)
    return path


STILL = [0.0, 0, 0, 0, 0, 0, 1]
MOVED = [0.1, 0, 0, 0, 0, np.sin(0.25), np.cos(0.25)]


@pytest.mark.parametrize("name", ["slide.mcap", "slide"])
def test_a_sequence_survives_the_bag(tmp_path, simulated_sequence, name):
    sequence = simulated_sequence(n=7)
    path = tmp_path / name
    write_bag(sequence, path)
    frames = list(read_bag(path))
    assert [frame.stamp_ns for frame in frames] == sequence.stamps_ns.tolist()
    for i, frame in enumerate(frames):
        np.testing.assert_array_equal(frame.image, sequence.image(i))
        expected = BASE_FROM_OBJECT @ sequence.poses_measured[i]
        np.testing.assert_allclose(frame.base_from_gel, expected, atol=1e-9)
        np.testing.assert_allclose(frame.object_from_gel_true, sequence.poses_true[i], atol=1e-9)
    expected = {"object": "test_object", "sequence": "test_object/00", "layout": "simulated"}
    assert bag_metadata(path) == expected
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([name, "test_object"])


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
    content = STORE.types["midastouch_msgs/msg/TactileContact"](header(SECOND, GEL_FRAME), True, 2e-5)
    data = bytes(STORE.serialize_cdr(content, content.__msgtype__))
    path = write(tmp_path / "x.mcap", Message("/tactile/contact", content.__msgtype__, SECOND, data))
    with AnyReader([path]) as reader:
        (connection,) = reader.connections
        (_, _, stored) = next(reader.messages())
        assert reader.deserialize(stored, connection.msgtype).area == pytest.approx(2e-5)


def test_poses_are_interpolated_at_the_images_stamp_not_at_arrival(tmp_path):
    """The second transform is recorded after the image, and both long after they were true."""
    path = write(
        tmp_path / "x.mcap",
        tf(SECOND, STILL, recorded_ns=50 * SECOND),
        image(SECOND + SECOND // 4, recorded_ns=51 * SECOND),
        tf(2 * SECOND, MOVED, recorded_ns=52 * SECOND),
    )
    (frame,) = read_bag(path)
    np.testing.assert_allclose(frame.base_from_gel[:3, 3], [0.025, 0, 0], atol=1e-12)
    np.testing.assert_allclose(se3.log(frame.base_from_gel)[5], 0.125, atol=1e-12)
    assert frame.object_from_gel_true is None


def test_images_outside_the_transforms_are_left_out(tmp_path):
    stamps = [SECOND // 2, SECOND, 2 * SECOND, 3 * SECOND]
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), tf(2 * SECOND, MOVED), *(image(stamp) for stamp in stamps))
    assert [frame.stamp_ns for frame in read_bag(path)] == [SECOND, 2 * SECOND]


def test_a_chain_with_a_static_mount(tmp_path):
    path = write(
        tmp_path / "x.mcap",
        tf(SECOND, MOVED, child="tool0"),
        tf(0, [0, 0, 0.1, 0, 0, 0, 1], parent="tool0", recorded_ns=SECOND, topic="/tf_static"),
        image(SECOND),
    )
    (frame,) = read_bag(path)
    np.testing.assert_allclose(frame.base_from_gel[:3, 3], [0.1, 0, 0.1], atol=1e-12)


def test_frames_that_do_not_matter_may_have_odd_clocks_and_values(tmp_path):
    odd = [tf(stamp, STILL, child="tracker", recorded_ns=SECOND + i) for i, stamp in enumerate([9 * SECOND, 0, SECOND])]
    above = [
        tf(stamp, STILL, parent="map", child=BASE_FRAME, recorded_ns=SECOND + i)
        for i, stamp in enumerate([9 * SECOND, SECOND])
    ]
    broken = [tf(SECOND, [0, 0, 0, 0, 0, 0, 0], child="hand"), tf(SECOND + 1, [np.nan, 0, 0, 0, 0, 0, 1])]
    path = write(tmp_path / "x.mcap", *odd, *above, *broken, tf(SECOND, STILL), tf(2 * SECOND, MOVED), image(SECOND))
    (frame,) = read_bag(path)
    np.testing.assert_allclose(frame.base_from_gel, np.eye(4), atol=1e-12)


def test_bgr_padded_and_compressed_images(tmp_path):
    pixels = np.zeros((320, 240, 3), np.uint8)
    pixels[..., 0] = 200
    padded = np.zeros((320, 250, 3), np.uint8)
    padded[:, :240, 2] = 200
    wide = image(SECOND, padded, "bgr8")
    content = STORE.deserialize_cdr(wide.data, wide.type_name)
    content.width = 240
    wide = dataclasses.replace(wide, data=bytes(STORE.serialize_cdr(content, wide.type_name)))
    kind = "sensor_msgs/msg/CompressedImage"
    png = cv2.imencode(".png", pixels[..., ::-1])[1]
    content = STORE.types[kind](header(SECOND, "digit_optical_frame"), "png", png)
    compressed = Message("/compressed", kind, SECOND, bytes(STORE.serialize_cdr(content, kind)))
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), wide, compressed)
    for topic in ("/image_raw", "/compressed"):
        (frame,) = read_bag(path, image_topic=topic)
        np.testing.assert_array_equal(frame.image, pixels)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (image(SECOND, encoding="mono16"), "mono16' is not colour"),
        (image(SECOND, step=100), "but holds"),
        (image(SECOND, np.zeros((240, 320, 3), np.uint8)), "320 x 240 pixels, expected 240 x 320; rotate it"),
        (Message("/image_raw", "sensor_msgs/msg/Image", SECOND, b"\0\1"), "cannot be read as a bag"),
        (tf(SECOND, STILL, topic="/image_raw"), "has a pose|TFMessage; record images"),
    ],
)
def test_images_that_are_none_are_refused(tmp_path, bad, message):
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), tf(2 * SECOND, STILL), bad)
    with pytest.raises(InputError, match=message) as error:
        list(read_bag(path))
    assert "x.mcap" in str(error.value)


def looped(child):
    """Transforms of 2 to 9 s, and again until 4 s."""
    stamps = [*range(2, 10), 2, 3, 4]
    return [tf(s * SECOND, STILL, child=child, recorded_ns=(i + 2) * SECOND) for i, s in enumerate(stamps)]


@pytest.mark.parametrize(
    ("messages", "message"),
    [
        ([image(SECOND)], "has no /tf, /tf_static; it has /image_raw"),
        ([tf(SECOND, STILL)], "has no /image_raw; it has /tf"),
        ([tf(SECOND, STILL), image(2 * SECOND)], "no image on /image_raw has a pose"),
        ([tf(SECOND, STILL, child="tool0"), image(SECOND)], "'digit_gel_frame' is not known"),
        ([tf(SECOND, [0, 0, 0, 0, 0, 0, 0]), image(SECOND)], "rotation is zero"),
        ([tf(SECOND, [np.nan, 0, 0, 0, 0, 0, 1]), image(SECOND)], "NaN"),
        (
            [*looped(GEL_FRAME), image(2 * SECOND)],
            f"the time of frame '{GEL_FRAME}' runs backwards at 2.000 s; split",
        ),
        (
            [
                *looped("tool0"),
                tf(0, STILL, parent="tool0", recorded_ns=SECOND, topic="/tf_static"),
                image(2 * SECOND),
            ],
            "the time of frame 'tool0' runs backwards at 2.000 s; split",
        ),
    ],
)
def test_bags_without_what_is_needed_say_so(tmp_path, messages, message):
    path = write(tmp_path / "x.mcap", *messages)
    with pytest.raises(InputError, match=message) as error:
        list(read_bag(path))
    assert "x.mcap" in str(error.value)


def moving(stamps_ms, wrong=()):
    """Transforms along x, 1 mm a millisecond, recorded in this order; those of the positions in `wrong` lie."""
    rows = [[9.0 if i in wrong else 1e-3 * s, 0, 0, 0, 0, 0, 1] for i, s in enumerate(stamps_ms)]
    return [
        tf(s * MS, row, recorded_ns=(20_000 + i) * MS) for i, (s, row) in enumerate(zip(stamps_ms, rows, strict=True))
    ]


@pytest.mark.parametrize(
    ("stamps_ms", "wrong", "late", "left_out"),
    [
        ([*range(0, 5000, 100)], (), 0, 0),
        ([0, 100, 100, 200, 200, 300, 3000], (2, 4), 0, 2),  # two nodes publish the same
        ([0, 200, 100, 400, 300, 2000, 1100, 3000], (), 3, 0),
        ([*range(0, 3900, 100), 1900, *range(3900, 5000, 100)], (39,), 0, 1),  # 1.9 s late, and there already
        ([*range(0, 3900, 100), 1900, 2000, 2100, *range(3900, 5000, 100)], (39, 40, 41), 0, 3),
        ([*range(0, 3900, 100), 1950, *range(3900, 5000, 100)], (39,), 0, 1),  # later than anybody waits
        ([s for i in range(40) for s in (100 * i + 3000, 100 * i)], range(1, 80, 2), 0, 40),  # another clock
    ],
)
def test_transforms_late_or_twice_are_sorted_in_or_left_out_and_told(
    tmp_path, capsys, stamps_ms, wrong, late, left_out
):
    asked = [s for i, s in enumerate(stamps_ms) if i not in wrong]
    images = [image(s * MS, recorded_ns=30_000 * MS) for s in asked]
    path = write(tmp_path / "x.mcap", *moving(stamps_ms, wrong), *images)
    frames = list(read_bag(path))
    assert [frame.stamp_ns for frame in frames] == [s * MS for s in asked]
    np.testing.assert_allclose([f.base_from_gel[0, 3] for f in frames], 1e-3 * np.array(asked), atol=1e-9)
    told = f"{path}: transforms of '{GEL_FRAME}': {late} late, sorted in; "
    told += f"{left_out} repeated or more than 1 s late, left out\n"
    assert capsys.readouterr().err == (told if late or left_out else "")


@pytest.mark.parametrize("back_ms", [1200, 4900])
def test_a_time_that_is_set_back_and_goes_on_is_no_late_transform(tmp_path, back_ms):
    stamps = [*range(0, 5000, 100), *range(5000 - back_ms, 9000, 100)]
    path = write(tmp_path / "x.mcap", *moving(stamps), image(1000 * MS, recorded_ns=30_000 * MS))
    with pytest.raises(InputError, match=f"runs backwards at {1e-3 * (5000 - back_ms):.3f} s; split the bag there"):
        list(read_bag(path))


def test_damaged_and_foreign_bags(tmp_path, simulated_sequence):
    whole = tmp_path / "whole.mcap"
    write_bag(simulated_sequence(n=3), whole)
    content = whole.read_bytes()
    bad = tmp_path / "bad.mcap"
    for damaged in (b"", b"not a bag", content[:100], content[:9] + bytes(200) + content[209:]):
        bad.write_bytes(damaged)
        with pytest.raises(InputError, match=r"bad\.mcap"):
            list(read_bag(bad))
    for foreign in (tmp_path / "nowhere.mcap", tmp_path, tmp_path / "test_object"):
        assert not is_bag(foreign)
        with pytest.raises(InputError, match="not a bag"):
            list(bag_messages(foreign))
    with pytest.raises(InputError, match="not a bag"):
        bag_metadata(tmp_path)


def test_a_bag_folder_without_its_file(tmp_path, simulated_sequence):
    path = tmp_path / "slide"
    write_bag(simulated_sequence(n=2), path)
    (path / "slide.mcap").unlink()
    with pytest.raises(InputError, match="slide"):
        list(read_bag(path))


def test_a_failure_leaves_nothing_behind(tmp_path):
    def fail():
        with BagWriter(tmp_path / "bags" / "x.mcap") as bag:
            bag.write(tf(SECOND, STILL))
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        fail()
    assert list((tmp_path / "bags").iterdir()) == []


def test_a_failed_conversion_keeps_the_old_bag(tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=3)
    path = tmp_path / "x.mcap"
    write_bag(sequence, path)
    sequence.image_paths[1].write_bytes(b"")
    with pytest.raises(InputError, match=r"1\.jpg"):
        write_bag(sequence, path)
    assert len(list(bag_messages(path, {"/image_raw"}))) == 3
    assert sorted(file.name for file in tmp_path.iterdir()) == ["test_object", "x.mcap"]


def test_a_bag_replaces_a_bag_but_nothing_else(tmp_path):
    folder = tmp_path / "bag"
    write(folder, tf(SECOND, STILL), tf(2 * SECOND, STILL))
    write(folder, tf(SECOND, STILL))
    assert len(list(bag_messages(folder))) == 1
    shutil.rmtree(folder)
    folder.mkdir()
    (folder / "thesis.txt").write_text("precious")
    with pytest.raises(InputError, match="not a bag; choose another name"):
        write(folder, tf(SECOND, STILL))
    assert (folder / "thesis.txt").read_text() == "precious"


def test_an_empty_bag_is_a_bag(tmp_path):
    path = write(tmp_path / "x.mcap")
    assert bag_metadata(path) == {}
    with pytest.raises(InputError, match="it has nothing"):
        list(read_bag(path))
