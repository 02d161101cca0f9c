"""Markers on the gel and a border around it are named from the no-contact image."""

import cv2
import numpy as np
import pytest

from midastouch_perception.tdn.gel_view import view_problem


def gel(seed: int = 0) -> np.ndarray:
    """A no-contact image (320, 240, 3), darker away from the lamps, with some specks of dust."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-1:1:320j, -1:1:240j]
    light = np.stack([np.exp(-((x + 0.5) ** 2)), np.exp(-((x - 0.5) ** 2)), np.exp(-((y - 0.6) ** 2))], axis=-1)
    image = 30 + 110 * light
    for _ in range(8):
        cv2.circle(image, (int(rng.integers(240)), int(rng.integers(320))), int(rng.integers(1, 6)), (40, 40, 40), -1)
    return np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)


def with_markers(image: np.ndarray, pitch: int, radius: int, darkness: float) -> np.ndarray:
    rng, mask = np.random.default_rng(1), np.zeros(image.shape[:2], np.float32)
    for y in range(pitch // 2, 320, pitch):
        for x in range(pitch // 2, 240, pitch):
            off = rng.normal(0, 1, 2).round().astype(int)
            cv2.circle(mask, (x + int(off[0]), y + int(off[1])), radius, 1, -1)
    return (image * (1 - darkness * cv2.GaussianBlur(mask, (0, 0), 1.0)[..., None])).astype(np.uint8)


def with_border(image: np.ndarray, margin: int, radius: int) -> np.ndarray:
    mask, ends = np.zeros(image.shape[:2], np.float32), margin + radius
    cv2.rectangle(mask, (ends, margin), (239 - ends, 319 - margin), 1, -1)
    cv2.rectangle(mask, (margin, ends), (239 - margin, 319 - ends), 1, -1)
    for x in (ends, 239 - ends):
        for y in (ends, 319 - ends):
            cv2.circle(mask, (x, y), radius, 1, -1)
    return (8 + (image - 8.0) * cv2.GaussianBlur(mask, (0, 0), 2.0)[..., None]).clip(0).astype(np.uint8)


@pytest.mark.parametrize("seed", range(5))
def test_gel_alone_is_a_good_view(seed):
    assert view_problem(gel(seed)) == ""


@pytest.mark.parametrize(("pitch", "radius", "darkness"), [(30, 5, 0.3), (20, 3, 0.6), (14, 3, 0.8), (45, 7, 0.5)])
def test_markers_are_named_with_what_to_do(pitch, radius, darkness):
    problem = view_problem(with_markers(gel(), pitch, radius, darkness))
    assert "the gel has markers" in problem
    assert "use a gel without markers" in problem


@pytest.mark.parametrize(("margin", "radius"), [(0, 25), (8, 20), (20, 40)])
def test_a_dark_border_is_named_with_the_fix(margin, radius):
    problem = view_problem(with_border(gel(), margin, radius))
    assert "dark border" in problem
    assert "set `crop`" in problem


def test_no_contact_images_of_real_sensors(shared):
    files = [*(shared / "data/digit_backgrounds").glob("*.jpg"), *(shared / "data").glob("*/*/background.png")]
    assert len(files) > 24
    for file in files:
        image = cv2.imread(str(file))
        if image.shape == (320, 240, 3):
            assert view_problem(image) == "", file
