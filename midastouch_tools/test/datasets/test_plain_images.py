"""Image folders and videos without poses, good and bad."""

import cv2
import numpy as np
import pytest
from sequences import write_video

from midastouch_common.errors import InputError
from midastouch_tools.datasets.plain_images import PlainImages


def write_images(folder, names, shape=(320, 240, 3)):
    """Uniform images; image i is blue = 10 i, red = 200."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full(shape, (10 * i, 0, 200), np.uint8))
    return folder


def test_a_folder_plays_in_numeric_order_at_a_digit_s_rate(tmp_path):
    names = ["9.png", "10.png", "100.png", "a2.png", "a10.png", "b.PNG"]
    folder = write_images(tmp_path / "x", names)
    (folder / "notes.txt").touch()
    images = PlainImages(folder)
    assert (images.n_frames, images.fps) == (6, 60.0)
    stamps, pixels = zip(*images.frames(), strict=True)
    assert [tuple(image[0, 0]) for image in pixels] == [(200, 0, 10 * i) for i in range(6)]
    assert [stamp - stamps[0] for stamp in stamps] == [round(i * 1e9 / 60) for i in range(6)]
    assert [stamp for stamp, _ in images.frames(offset_ns=stamps[3] - stamps[0])] == [*stamps[3:]]


def test_a_video_plays_at_its_own_rate_and_the_sensor_s_size(tmp_path):
    images = PlainImages(write_video(tmp_path / "v.avi", [np.full((640, 480, 3), 20 * i, np.uint8) for i in range(3)]))
    assert (images.n_frames, images.fps) == (3, 25.0)
    frames = list(images.frames())
    assert {image.shape for _, image in frames} == {(320, 240, 3)}
    np.testing.assert_allclose([image.mean() for _, image in frames], [0, 20, 40], atol=3)
    assert frames[2][0] - frames[0][0] == 80_000_000


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("images/0.jpg", b"", r"0\.jpg.*get the file again"),
        ("images/0.jpg", b"no picture", r"0\.jpg.*get the file again"),
        ("bad.mp4", b"no video", r"bad\.mp4.*give an \.mp4"),
    ],
)
def test_what_is_no_image_or_video_is_named(tmp_path, name, content, reason):
    (path := tmp_path / name).parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    with pytest.raises(InputError, match=reason):
        PlainImages(tmp_path / name.partition("/")[0])


def test_landscape_images_are_refused_with_the_turn_they_need(tmp_path):
    with pytest.raises(InputError, match=r"0\.png.*320 x 240.*rotate it .rotation 90"):
        PlainImages(write_images(tmp_path / "x", ["0.png"], (240, 320, 3)))
    with pytest.raises(InputError, match=r"v\.avi.*rotate it"):
        PlainImages(write_video(tmp_path / "v.avi", [np.zeros((240, 320, 3), np.uint8)] * 2))


def test_a_video_without_an_index_plays_at_unknown_length(tmp_path):
    jpeg = cv2.imencode(".jpg", np.zeros((320, 240, 3), np.uint8))[1].tobytes()
    (tmp_path / "stream.mjpeg").write_bytes(3 * jpeg)
    images = PlainImages(tmp_path / "stream.mjpeg")
    assert len(list(images.frames())) == 3
    assert images.n_frames >= 1


@pytest.mark.parametrize("inside", ["tactile_images", "frames"])
def test_an_incomplete_ycb_slide_is_not_taken_for_plain_images(tmp_path, inside):
    write_images(tmp_path, ["background.png"])
    assert PlainImages.are_at(tmp_path)
    write_images(tmp_path / inside, ["0.png"])
    assert not PlainImages.are_at(tmp_path)
    assert PlainImages.are_at(tmp_path / inside)
