"""Images are whole or refused, whatever was cut off."""

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


@pytest.mark.parametrize("ending", [".png", ".bmp"])
def test_other_formats_are_refused_as_their_decoder_does(ending):
    whole = encoded(ending)
    np.testing.assert_array_equal(decode_image(np.frombuffer(whole, np.uint8)), PICTURE)
    with pytest.raises(BrokenImageError, match="not a readable image"):
        decode_image(whole[: len(whole) // 2])


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
