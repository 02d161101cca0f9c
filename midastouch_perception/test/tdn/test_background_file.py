from __future__ import annotations

import cv2
import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.tdn.background_file import read_background

GREY = np.full((320, 240, 3), 100, np.uint8)


def test_background_from_a_file_is_rgb(tmp_path):
    rgb = np.random.default_rng(2).integers(0, 256, (320, 240, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "background.png"), rgb[:, :, ::-1])
    np.testing.assert_array_equal(read_background(tmp_path / "background.png", 320, 240), rgb)


def test_background_from_a_folder_is_the_median_of_its_images(tmp_path):
    for i in range(12):
        image = GREY.copy()
        image[20 * i : 20 * i + 40, 100:140] += 30
        cv2.imwrite(str(tmp_path / f"{i:03d}.png"), image)
    np.testing.assert_array_equal(read_background(tmp_path, 320, 240), GREY)


def test_a_folder_of_touches_at_one_place_is_refused(tmp_path):
    for i in range(8):
        image = GREY.copy()
        image[100:200] += np.uint8(10 * i)
        cv2.imwrite(str(tmp_path / f"{i:03d}.png"), image)
    with pytest.raises(InputError, match="touched in most of these images"):
        read_background(tmp_path, 320, 240)


def test_unusable_backgrounds_are_named(tmp_path):
    (tmp_path / "text.png").write_text("not an image")
    cv2.imwrite(str(tmp_path / "small.png"), GREY[:100])
    (tmp_path / "empty").mkdir()
    for name, complaint in (
        ("none.png", "no such"),
        ("text.png", "not an image"),
        ("small.png", "240 x 100"),
        ("empty", "no PNG or JPEG"),
    ):
        with pytest.raises(InputError, match=complaint) as caught:
            read_background(tmp_path / name, 320, 240)
        assert name in str(caught.value)
