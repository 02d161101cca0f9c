from __future__ import annotations

import cv2
import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.background_store import BackgroundStore
from midastouch_perception.tdn.sensor_background import SensorBackground


def image(level: int) -> np.ndarray:
    return np.full((320, 240, 3), level, np.uint8)


def test_a_file_goes_over_what_was_kept_and_that_over_an_estimate(sensor, tmp_path):
    store = BackgroundStore(tmp_path, "D20001")
    store.save(image(90))
    cv2.imwrite(str(tmp_path / "given.png"), image(80))
    given = SensorBackground(sensor, str(tmp_path / "given.png"), store, 4)
    kept = SensorBackground(sensor, "", store, 4)
    estimated = SensorBackground(sensor, "", BackgroundStore(tmp_path, "D20002"), 4)
    assert (given.source, kept.source, estimated.source) == (
        f"file {tmp_path}/given.png",
        f"kept in {tmp_path}/D20001.png",
        "none yet",
    )
    for background in (given, kept, estimated):
        background.observe(image(100))
    assert [background.image[0, 0, 0] for background in (given, kept, estimated)] == [80, 90, 100]
    assert (estimated.source, estimated.change) == ("the first 1 images", 0)


def test_a_captured_image_ends_the_estimate_and_is_kept(sensor, tmp_path):
    store = BackgroundStore(tmp_path, "D20001")
    background = SensorBackground(sensor, "", store, 4)
    background.observe(image(100))
    background.observe(image(130))
    assert background.change == 30
    assert background.replace(image(70)) == f"kept in {tmp_path}/D20001.png"
    background.observe(image(100))
    assert (background.source, background.change) == ("capture_background", 0)
    np.testing.assert_array_equal(store.load(320, 240), background.image)
    unkept = SensorBackground(sensor, "", None, 4)
    assert "set the parameter serial" in unkept.replace(image(70))


def test_what_cannot_be_right_is_said(sensor):
    background = SensorBackground(sensor, "", None, 4)
    background.observe(image(0))
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
