from __future__ import annotations

import numpy as np

from midastouch_perception.tdn.background_capture import BackgroundCapture, RunningBackground, largest_change

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
