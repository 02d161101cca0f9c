"""What goes in comes out frame by frame, with poses at the stamps of the images."""

import re

import numpy as np
import pytest
from recorded import MOVED, SECOND, STILL, STORE, compressed, cut_off, edited, image, tf, write

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.frames import BASE_FROM_OBJECT, GEL_FRAME
from midastouch_tools.bags.images import GelStream, read_bag
from midastouch_tools.bags.messages import COMPRESSED_TYPE, Message, header
from midastouch_tools.bags.reader import bag_metadata
from midastouch_tools.bags.writer import write_bag


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


def test_poses_are_those_at_the_image_s_stamp_not_at_arrival(tmp_path):
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


def test_images_outside_the_transforms_are_left_out_and_counted(tmp_path, capsys):
    stamps = [SECOND // 2, SECOND, 2 * SECOND, 3 * SECOND]
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), tf(2 * SECOND, MOVED), *(image(stamp) for stamp in stamps))
    assert [frame.stamp_ns for frame in read_bag(path)] == [SECOND, 2 * SECOND]
    assert "x.mcap: 2 of 4 images have no pose and are left out: " in capsys.readouterr().err


SPAN = tf(SECOND, STILL), tf(2 * SECOND, STILL)


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
        ([*looped(GEL_FRAME), image(2 * SECOND)], f"the time of frame '{GEL_FRAME}' runs backwards at 2.000 s; split"),
        (
            [*looped("tool0"), tf(0, STILL, parent="tool0", recorded_ns=SECOND, topic="/tf_static"), image(2 * SECOND)],
            "the time of frame 'tool0' runs backwards at 2.000 s; split",
        ),
        ([*SPAN, image(SECOND, encoding="mono16")], "mono16' is not one of rgb8, bgr8"),
        ([*SPAN, image(SECOND, step=100)], "but holds"),
        ([*SPAN, image(SECOND, np.zeros((240, 320, 3), np.uint8))], "320 x 240 pixels, expected 240 x 320; rotate it"),
        ([*SPAN, Message("/image_raw", "sensor_msgs/msg/Image", SECOND, b"\0\1")], "cannot be read as a bag"),
        ([*SPAN, tf(SECOND, STILL, topic="/image_raw")], "has a pose|TFMessage; record images"),
    ],
)
def test_bags_without_what_is_needed_say_so(tmp_path, messages, message):
    path = write(tmp_path / "x.mcap", *messages)
    with pytest.raises(InputError, match=message) as error:
        list(read_bag(path))
    assert "x.mcap" in str(error.value)


def test_bgr_padded_and_compressed_images(tmp_path):
    pixels = np.zeros((320, 240, 3), np.uint8)
    pixels[..., 0] = 200
    padded = np.zeros((320, 250, 3), np.uint8)
    padded[:, :240, 2] = 200
    wide = image(SECOND, padded, "bgr8")
    wide = edited(wide, lambda content: setattr(content, "width", 240))
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), wide, compressed(image(SECOND, pixels)))
    for topic in ("/image_raw", "/image_raw/compressed"):
        (frame,) = read_bag(path, GelStream(topic))
        np.testing.assert_array_equal(frame.image, pixels)


def test_compressed_images_stand_in_where_there_are_no_others(tmp_path):
    raw = image(SECOND, np.random.default_rng(0).integers(0, 256, (320, 240, 3), np.uint8))
    frames = {}
    for name, recorded in {"raw": [raw], "small": [compressed(raw)], "both": [raw, compressed(raw)]}.items():
        path = write(tmp_path / f"{name}.mcap", tf(SECOND, STILL), *recorded)
        ((_, frames[name], *_),) = read_bag(path)
    np.testing.assert_array_equal(frames["small"], frames["raw"])
    np.testing.assert_array_equal(frames["both"], frames["raw"])
    with pytest.raises(InputError, match=r"/other.* has /image_raw/compressed"):
        next(read_bag(tmp_path / "small.mcap", GelStream("/other")))


@pytest.mark.parametrize("data", [b"", b"no picture"])
def test_compressed_images_that_are_none_are_refused(tmp_path, data):
    content = STORE.types[COMPRESSED_TYPE](header(SECOND, "camera"), "png", np.frombuffer(data, np.uint8))
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), Message.of("/image_raw/compressed", content, SECOND))
    with pytest.raises(InputError, match=r"x\.mcap: .*/image_raw/compressed"):
        next(read_bag(path))


def test_damaged_images_are_left_out_and_counted(tmp_path, capsys):
    jpegs = [compressed(image(SECOND + i), ".jpg") for i in range(4)]
    jpegs[1:3] = map(cut_off, jpegs[1:3])
    fault = r"x\.mcap: image on /image_raw/compressed at 1\.000 s: JPEG .* is cut off.*record it again"
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), tf(2 * SECOND, STILL), *jpegs)
    assert [frame.stamp_ns for frame in read_bag(path)] == [SECOND, SECOND + 3]
    assert re.search(rf"{fault} \(2 of 4 images are damaged and left out\)", capsys.readouterr().err)
    path.unlink()
    write(path, tf(SECOND, STILL), tf(2 * SECOND, STILL), *jpegs[1:3])
    with pytest.raises(InputError, match=fault):
        next(read_bag(path))


def test_topic_and_frames_of_a_bag_may_have_other_names(tmp_path):
    turned = [0.2, 0, 0, 0, 0, 1, 0]
    messages = [
        message
        for stamp in (SECOND, 2 * SECOND)
        for message in (tf(stamp, turned, "part", "left_gel"), image(stamp, topic="/left/image_raw"))
    ]
    stream = GelStream("/left/image_raw", "part", "left_gel")
    frames = list(read_bag(write(tmp_path / "left.mcap", *messages), stream))
    np.testing.assert_allclose([frame.base_from_gel[0, 3] for frame in frames], 0.2)
    assert len(frames) == 2
