from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.background_store import (
    BackgroundStore,
    SensorBackground,
    default_folder,
    read_background,
)


def grey(level: int) -> np.ndarray:
    return np.full((320, 240, 3), level, np.uint8)


@pytest.fixture
def image() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, (320, 240, 3), dtype=np.uint8)


def test_each_sensor_gets_its_own_image_back_bit_by_bit(tmp_path, image):
    BackgroundStore(tmp_path / "new", "D20001").save(image)
    BackgroundStore(tmp_path / "new", "D20002").save(image[::-1])
    np.testing.assert_array_equal(BackgroundStore(tmp_path / "new", "D20001").load(320, 240), image)
    np.testing.assert_array_equal(BackgroundStore(tmp_path / "new", "D20002").load(320, 240), image[::-1])
    assert BackgroundStore(tmp_path / "new", "D20003").load(320, 240) is None
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["D20001.png", "D20002.png"]


@pytest.mark.parametrize("serial", ["", "..", "../D1", "a/b", "/D1", ".hidden", "D1\n", "D" * 65])
def test_serials_that_would_leave_the_folder_are_refused(tmp_path, serial):
    with pytest.raises(InputError, match="not a serial number"):
        BackgroundStore(tmp_path, serial)


def test_a_damaged_or_foreign_file_is_named(tmp_path, image):
    store = BackgroundStore(tmp_path, "D20001")
    store.save(image)
    with pytest.raises(InputError, match=r"240 x 320.*480 x 640"):
        store.load(640, 480)
    store.path.write_bytes(b"no image")
    with pytest.raises(InputError, match=r"D20001\.png"):
        store.load(320, 240)
    with pytest.raises(InputError, match="was not kept"):
        BackgroundStore(store.path, "D20001").save(image)
    assert store.path.read_bytes() == b"no image"


def test_the_folder_is_where_ros_remembers(monkeypatch, tmp_path):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "midastouch" / "backgrounds"
    monkeypatch.delenv("ROS_HOME")
    assert default_folder() == Path("~/.ros/midastouch/backgrounds").expanduser()


def test_a_background_is_an_rgb_file_or_the_median_of_a_folder(tmp_path, image):
    cv2.imwrite(str(tmp_path / "background.png"), image[:, :, ::-1])
    np.testing.assert_array_equal(read_background(tmp_path / "background.png", 320, 240), image)
    (tmp_path / "moving").mkdir()
    for i in range(12):
        frame = grey(100)
        frame[20 * i : 20 * i + 40, 100:140] += 30
        cv2.imwrite(str(tmp_path / "moving" / f"{i:03d}.png"), frame)
    np.testing.assert_array_equal(read_background(tmp_path / "moving", 320, 240), grey(100))


def test_unusable_backgrounds_are_named(tmp_path):
    (tmp_path / "text.png").write_text("not an image")
    cv2.imwrite(str(tmp_path / "small.png"), grey(100)[:100])
    for name in ("empty", "still"):
        (tmp_path / name).mkdir()
    for i in range(8):
        frame = grey(100)
        frame[100:200] += np.uint8(10 * i)
        cv2.imwrite(str(tmp_path / "still" / f"{i:03d}.png"), frame)
    for name, complaint in (
        ("none", "no such image, nor a folder of images"),
        ("text.png", "not a readable image"),
        ("small.png", "240 x 100"),
        ("empty", "no PNG or JPEG"),
        ("still", "without contact"),
    ):
        with pytest.raises(InputError, match=complaint) as caught:
            read_background(tmp_path / name, 320, 240)
        assert name in str(caught.value)


def test_a_file_goes_over_a_kept_one_and_that_over_an_estimate(sensor, tmp_path):
    store = BackgroundStore(tmp_path, "D20001")
    store.save(grey(90))
    cv2.imwrite(str(tmp_path / "given.png"), grey(80))
    given = SensorBackground(sensor, str(tmp_path / "given.png"), store, 4)
    kept = SensorBackground(sensor, "", store, 4)
    estimated = SensorBackground(sensor, "", BackgroundStore(tmp_path, "D20002"), 4)
    assert (given.source, kept.source, estimated.source) == (
        f"file {tmp_path}/given.png",
        f"kept in {tmp_path}/D20001.png",
        "none yet",
    )
    for background in (given, kept, estimated):
        background.observe(grey(100))
    assert [background.image[0, 0, 0] for background in (given, kept, estimated)] == [80, 90, 100]
    assert (estimated.source, estimated.change) == ("the first 1 images", 0)


def test_a_captured_image_ends_the_estimate_and_is_kept(sensor, tmp_path):
    store = BackgroundStore(tmp_path, "D20001")
    background = SensorBackground(sensor, "", store, 4)
    background.observe(grey(100))
    background.observe(grey(130))
    assert background.change == 30
    assert background.replace(grey(70)) == f"kept in {tmp_path}/D20001.png"
    background.observe(grey(100))
    assert (background.source, background.change) == ("capture_background", 0)
    np.testing.assert_array_equal(store.load(320, 240), background.image)
    unkept = SensorBackground(sensor, "", None, 4)
    assert "set the parameter serial" in unkept.replace(grey(70))


def test_what_cannot_be_right_is_said(sensor):
    background = SensorBackground(sensor, "", None, 4)
    background.observe(grey(0))
    assert "black" in background.problem
    with pytest.raises(InputError, match=r"nowhere\.png"):
        SensorBackground(sensor, "nowhere.png", None, 4)


def test_only_images_of_a_digit_are_said_to_be_turned(shared):
    folder = shared / "data/digit_real/ball_presses"
    turned = np.ascontiguousarray(cv2.imread(str(folder / "background.png"))[::-1, ::-1, ::-1])
    for name, said in (("digit_real", "upside down"), ("gelsight_mini", "")):
        background = SensorBackground(SensorModel.load(name), "", None, 1)
        background.observe(turned)
        assert said in background.problem
        assert bool(said) == bool(background.problem)
