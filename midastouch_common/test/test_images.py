"""Images are whole or refused, whatever was cut off."""

import contextlib

import cv2
import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_common.images import BrokenImageError, decode_image, image_files, read_image_file

PICTURE = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (320, 240, 3), np.uint8), (0, 0), 4)


def encoded(ending: str, *options: int) -> bytes:
    return cv2.imencode(ending, PICTURE, options)[1].tobytes()


JPEGS = {
    "baseline": encoded(".jpg"),
    "progressive": encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    "restarts": encoded(".jpg", cv2.IMWRITE_JPEG_RST_INTERVAL, 3),
}


def with_thumbnail(jpeg: bytes) -> bytes:
    """The JPEG with a small one, which has an end of its own, in its description, as cameras write it."""
    small = cv2.imencode(".jpg", PICTURE[::8, ::8])[1].tobytes()
    return jpeg[:2] + b"\xff\xe2" + (len(small) + 2).to_bytes(2, "big") + small + jpeg[2:]


@pytest.mark.parametrize("name", JPEGS)
@pytest.mark.parametrize("dress", [bytes, with_thumbnail])
def test_a_jpeg_is_taken_whole_and_refused_without_its_end(tmp_path, name, dress):
    jpeg, path = dress(JPEGS[name]), tmp_path / "frame.jpg"
    for padding in (b"", bytes(100), b"\nnotes of a camera"):
        path.write_bytes(jpeg + padding)
        np.testing.assert_array_equal(read_image_file(path), cv2.imread(str(path)))
    for length in (len(jpeg) - 2, len(jpeg) - 1, len(jpeg) // 2, 100):
        path.write_bytes(jpeg[:length])
        with pytest.raises(BrokenImageError, match=r"frame\.jpg: JPEG of \d+ bytes is cut off.*; get the file again"):
            read_image_file(path)


DAMAGE = {
    "zeros": lambda data, at: data[:at] + bytes(200) + data[at + 200 :],
    "noise": lambda data, at: data[:at] + np.random.default_rng(at).bytes(200) + data[at + 200 :],
    "lost": lambda data, at: data[:at] + data[at + 200 :],
    "ones": lambda data, at: data[:at] + b"\xff" * 20 + data[at + 20 :],
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
@pytest.mark.parametrize("name", [*JPEGS, ".png"])
def test_an_image_damaged_in_the_middle_is_refused(tmp_path, name, damage):
    """Except where the codes fall into step again, so that all of them decode, which is rare."""
    whole, path = {**JPEGS, ".png": encoded(".png")}[name], tmp_path / "frame.jpg"
    places = range(len(whole) // 3, 2 * len(whole) // 3, len(whole) // 60)
    refused = 0
    for at in places:
        path.write_bytes(damage(whole, at))
        with contextlib.suppress(BrokenImageError):
            read_image_file(path)
            continue
        refused += 1
    assert refused >= 0.8 * len(places), f"{refused} of {len(places)}"
    with pytest.raises(BrokenImageError, match=r"frame\.jpg: .*(damaged|cut off|not a readable).*; get the file again"):
        read_image_file(path)


@pytest.mark.parametrize("flags", [cv2.IMREAD_COLOR, cv2.IMREAD_GRAYSCALE, cv2.IMREAD_REDUCED_COLOR_4])
@pytest.mark.parametrize("shape", [(1, 1), (17, 33), (320, 240)])
def test_a_jpeg_has_the_pixels_that_opencv_reads(flags, shape):
    jpeg = cv2.imencode(".jpg", PICTURE[: shape[0], : shape[1]])[1]
    np.testing.assert_array_equal(decode_image(jpeg, flags), cv2.imdecode(jpeg, flags))
    # with bytes before the end, as of cameras that send whole words
    padded = jpeg.tobytes()[:-2] + bytes(4) + b"\xff\xd9"
    np.testing.assert_array_equal(decode_image(padded, flags), cv2.imdecode(jpeg, flags))


def test_the_jpeg_of_a_camera_may_lack_the_usual_tables():
    jpeg = JPEGS["baseline"]
    while (at := jpeg.find(b"\xff\xc4")) > 0:
        jpeg = jpeg[:at] + jpeg[at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big") :]
    np.testing.assert_array_equal(decode_image(jpeg), decode_image(JPEGS["baseline"]))
    with pytest.raises(BrokenImageError, match="is cut off"):
        decode_image(jpeg[:-2])


def test_a_jpeg_is_turned_as_its_camera_notes():
    upside_down = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0\0\0\0\0\0\0"
    jpeg = JPEGS["baseline"]
    turned = jpeg[:2] + b"\xff\xe1" + (len(upside_down) + 2).to_bytes(2, "big") + upside_down + jpeg[2:]
    np.testing.assert_array_equal(decode_image(turned), decode_image(jpeg)[::-1, ::-1])


@pytest.mark.parametrize(("ending", "fault"), [(".png", "PNG of .* is cut off"), (".bmp", "not a readable image")])
def test_other_formats_are_refused_if_they_are_cut_off(ending, fault):
    whole = encoded(ending)
    np.testing.assert_array_equal(decode_image(np.frombuffer(whole, np.uint8)), PICTURE)
    with pytest.raises(BrokenImageError, match=fault):
        decode_image(whole[: len(whole) // 2])


def test_each_part_of_a_png_is_checked():
    """OpenCV takes half a minute for the wrong length of a part, and the colours of some parts that are damaged."""
    whole = encoded(".png")
    length = whole.index(b"IDAT") - 4
    with pytest.raises(BrokenImageError, match=r"PNG of .* is cut off"):
        decode_image(whole[:length] + b"\x04\xff\xff\xff" + whole[length + 4 :])
    for at in range(length + 4, len(whole) - 12, len(whole) // 50):
        with pytest.raises(BrokenImageError, match=r"PNG of .* is (damaged|cut off)"):
            decode_image(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])


@pytest.mark.parametrize("data", [b"", b"no image", b"\xff\xd8", b"\xff\xd8\xff\xd9"])
def test_what_is_no_image_is_refused(data):
    with pytest.raises(BrokenImageError):
        decode_image(data)


def test_hidden_files_of_a_folder_are_no_images(tmp_path):
    for name in ("b.PNG", "a.jpg", "._a.jpg", ".press_03.1a2b.png", "notes.txt"):
        (tmp_path / name).touch()
    assert [path.name for path in image_files(tmp_path)] == ["a.jpg", "b.PNG"]


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.png: no such image file"):
        read_image_file(tmp_path / "none.png")
