"""Images in every form, and ones that are none."""

import dataclasses

import cv2
import numpy as np
import pytest
from recorded import SECOND, STILL, STORE, compressed, header, image, tf, write

from midastouch_bringup.bags.frames import GelStream, read_bag
from midastouch_bringup.bags.messages import COMPRESSED_TYPE, Message
from midastouch_common.errors import InputError


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
    small = Message("/compressed", kind, SECOND, bytes(STORE.serialize_cdr(content, kind)))
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), wide, small)
    for topic in ("/image_raw", "/compressed"):
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
    with pytest.raises(InputError, match=r"has no /other; it has /image_raw/compressed"):
        next(read_bag(tmp_path / "small.mcap", GelStream("/other")))


@pytest.mark.parametrize("data", [b"", b"no picture"])
def test_compressed_images_that_are_none_are_refused(tmp_path, data):
    content = STORE.types[COMPRESSED_TYPE](header(SECOND, "camera"), "png", np.frombuffer(data, np.uint8))
    bad = Message(
        "/image_raw/compressed", COMPRESSED_TYPE, SECOND, bytes(STORE.serialize_cdr(content, COMPRESSED_TYPE))
    )
    path = write(tmp_path / "x.mcap", tf(SECOND, STILL), bad)
    with pytest.raises(InputError, match=r"x\.mcap: image on /image_raw/compressed .* cannot be decompressed"):
        next(read_bag(path))


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (image(SECOND, encoding="mono16"), "mono16' is neither rgb8 nor bgr8"),
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
