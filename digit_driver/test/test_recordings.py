"""Image folders and videos on disk, good and bad, and the choice between them."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from digit_driver.errors import CorruptFrameError
from digit_driver.image_folder import ImageFolder, list_images
from digit_driver.sources import make_source
from digit_driver.v4l2_device import V4l2Camera, V4l2Settings
from digit_driver.video_file import VideoFile
from midastouch_common.errors import InputError


def write_images(folder: Path, names: list[str], shape=(320, 240, 3)) -> Path:
    """Uniform images; image i is blue = 10 i, red = 200."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, name in enumerate(names):
        bgr = np.zeros(shape, np.uint8)
        bgr[..., 0], bgr[..., 2] = 10 * i, 200
        cv2.imwrite(str(folder / name), bgr)
    return folder


def write_video(path: Path, frames: int, shape=(320, 240, 3)) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (shape[1], shape[0]))
    assert writer.isOpened()
    for i in range(frames):
        writer.write(np.full(shape, 20 * i, np.uint8))
    writer.release()
    return path


def test_numbers_are_sorted_by_value(tmp_path: Path) -> None:
    names = ["10.jpg", "9.jpg", "100.jpg", "a2.png", "a10.png", "notes.txt", "b.JPG"]
    for name in names:
        (tmp_path / name).touch()
    assert [path.name for path in list_images(tmp_path)] == [
        "9.jpg", "10.jpg", "100.jpg", "a2.png", "a10.png", "b.JPG",
    ]  # fmt: skip


def test_images_are_rgb_and_in_order(tmp_path: Path) -> None:
    source = ImageFolder(write_images(tmp_path, [f"{i}.png" for i in range(12)]), fps=1000.0)
    source.open()
    images = [source.read(1.0).image for _ in range(13)]
    assert [tuple(image[0, 0]) for image in images[:3]] == [(200, 0, 0), (200, 0, 10), (200, 0, 20)]
    assert [image[0, 0, 2] // 10 for image in images] == [*range(12), 0]


@pytest.mark.parametrize(("name", "fps"), [("tactile_images", 10.0), ("frames", 30.0)])
def test_sequence_folders_are_recognised_from_above_and_inside(tmp_path: Path, name, fps) -> None:
    folder = write_images(tmp_path / name, ["0.jpg"])
    (tmp_path / "background.png").write_bytes((folder / "0.jpg").read_bytes())
    for path in (tmp_path, folder):
        info = ImageFolder(path).open()
        assert (info.name, info.fps, info.live) == (str(folder), fps, False)


def test_plain_folder_plays_at_the_sensors_rate(tmp_path: Path) -> None:
    assert ImageFolder(write_images(tmp_path, ["0.jpg"])).open().fps == 60.0


def test_bad_folders_are_refused_with_a_reason(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a folder"):
        ImageFolder(tmp_path / "absent").open()
    with pytest.raises(InputError, match=r"holds no images.*YCB-Slide"):
        ImageFolder(tmp_path).open()
    (tmp_path / "0.jpg").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"0\.jpg cannot be decoded"):
        ImageFolder(tmp_path).open()
    (tmp_path / "0.jpg").write_bytes(b"")
    with pytest.raises(InputError, match=r"0\.jpg cannot be decoded"):
        ImageFolder(tmp_path).open()
    write_images(tmp_path, ["0.jpg"], (240, 320, 3))
    with pytest.raises(InputError, match=r"320 wide and 240 high.*portrait"):
        ImageFolder(tmp_path).open()


def test_a_damaged_or_vanished_image_is_passed_over(tmp_path: Path) -> None:
    source = ImageFolder(write_images(tmp_path, [f"{i}.png" for i in range(4)]), fps=1000.0)
    (tmp_path / "1.png").write_bytes(b"\x89PNG rubbish")
    source.open()
    (tmp_path / "2.png").unlink()
    assert source.read(1.0).sequence == 0
    for name in ("1.png", "2.png"):
        with pytest.raises(CorruptFrameError, match=name):
            source.read(1.0)
    assert source.read(1.0).sequence == 3


def test_video_plays_and_loops(tmp_path: Path) -> None:
    source = VideoFile(write_video(tmp_path / "v.avi", 3))
    info = source.open()
    assert (info.fps, info.width, info.height) == (30.0, 240, 320)
    levels = [int(source.read(1.0).image.mean()) for _ in range(5)]
    assert np.allclose(levels, [0, 20, 40, 0, 20], atol=3)
    source.close()


def test_bad_videos_are_refused_with_a_reason(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a file"):
        VideoFile(tmp_path / "absent.mp4").open()
    (tmp_path / "bad.mp4").write_bytes(b"no video")
    with pytest.raises(InputError, match=r"bad\.mp4 cannot be decoded"):
        VideoFile(tmp_path / "bad.mp4").open()
    with pytest.raises(InputError, match="portrait"):
        VideoFile(write_video(tmp_path / "wide.avi", 2, (240, 320, 3))).open()


def test_the_source_is_chosen_by_what_is_there(tmp_path: Path) -> None:
    device = V4l2Settings()
    assert isinstance(make_source(device), V4l2Camera)
    assert isinstance(make_source(device, str(tmp_path)), ImageFolder)
    (tmp_path / "v.mp4").touch()
    assert isinstance(make_source(device, str(tmp_path / "v.mp4")), VideoFile)
    with pytest.raises(InputError, match="does not exist"):
        make_source(device, str(tmp_path / "absent"))
