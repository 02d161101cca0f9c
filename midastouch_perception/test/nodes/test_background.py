from __future__ import annotations

import cv2
import numpy as np
import pytest

from midastouch_perception.errors import InputError
from midastouch_perception.nodes.background import (
    BackgroundCapture,
    RunningBackground,
    largest_change,
    read_background,
)

GREY = np.full((320, 240, 3), 100, np.uint8)


def noisy(rng: np.random.Generator, sigma: float = 2.0) -> np.ndarray:
    return np.clip(GREY + rng.normal(0, sigma, GREY.shape), 0, 255).round().astype(np.uint8)


def moving(frames: int) -> list[np.ndarray]:
    images = [GREY.copy() for _ in range(frames)]
    for i, image in enumerate(images):
        image[10 * i : 10 * i + 40, 100:140] += 30
    return images


def test_change_is_blind_to_noise_and_sees_a_small_contact_move():
    rng = np.random.default_rng(0)
    assert largest_change([noisy(rng) for _ in range(10)]) < 1.5
    assert largest_change(moving(3)) > 10


def test_capture_of_still_images_is_their_median():
    rng = np.random.default_rng(1)
    capture = BackgroundCapture(frames=15, still_threshold=2.0)
    for _ in range(15):
        assert not capture.done
        capture.add(noisy(rng))
    assert capture.done
    assert not capture.refusal
    assert np.abs(capture.image.astype(float) - GREY).mean() < 0.6


def test_capture_refuses_a_moving_contact():
    capture = BackgroundCapture(frames=10, still_threshold=2.0)
    for image in moving(10):
        capture.add(image)
    assert capture.image is None
    assert "not still" in capture.refusal


def test_running_background_is_there_at_once_and_forgets_a_passing_contact():
    running = RunningBackground(frames=16)
    images = moving(16)
    running.add(images[0])
    np.testing.assert_array_equal(running.image, images[0])
    for image in images[1:]:
        running.add(image)
    assert running.count == 16
    assert running.change > 10
    complete = running.image
    np.testing.assert_array_equal(complete, GREY)
    running.add(images[0])
    assert running.image is complete, "complete: later images change nothing"


def test_background_from_a_file_is_rgb(tmp_path):
    rgb = np.random.default_rng(2).integers(0, 256, (320, 240, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "background.png"), rgb[:, :, ::-1])
    np.testing.assert_array_equal(read_background(tmp_path / "background.png", 320, 240), rgb)


def test_background_from_a_folder_is_the_median_of_its_images(tmp_path):
    for i, image in enumerate(moving(12)):
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
