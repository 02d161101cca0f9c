from __future__ import annotations

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import estimate_background, load_tdn
from midastouch_perception.tdn.background import (
    RunningBackground,
    TouchedBackground,
    doubtful_fraction,
    largest_change,
    shows_contact,
)
from midastouch_simulation.optics import TactoOptics
from midastouch_tools.datasets.ball_presses import read_presses

GREY = np.full((320, 240, 3), 100, np.uint8)


@pytest.mark.parametrize(("shapes", "said"), [([], "no frames"), ([(320, 240, 3), (240, 320, 3)], "different size")])
def test_frames_that_make_no_background_are_refused(shapes, said):
    with pytest.raises(InputError, match=said):
        estimate_background([np.zeros(shape, np.uint8) for shape in shapes])


def slide(step: int) -> list[np.ndarray]:
    """A contact 60 rows high that moves on by `step` rows a frame and looks different in each."""
    frames = [GREY.copy() for _ in range(15)]
    for i, frame in enumerate(frames):
        frame[step * i : step * i + 60] += np.uint8(10 + 6 * i)
    return frames


def test_a_contact_that_moves_on_vanishes_unless_nearly_still():
    for step, doubtful in ((20, False), (2, True)):
        frames = slide(step)
        background = estimate_background(frames)
        assert (doubtful_fraction(frames, background) > 0.1) == doubtful
        assert np.array_equal(background, GREY) != doubtful
    agreed = [np.full((320, 240, 3), level, np.uint8) for level in (99, 100, 101)]
    assert doubtful_fraction(agreed, estimate_background(agreed)) == 0


@pytest.fixture(scope="module")
def tdn():
    return load_tdn("fast")


@pytest.fixture(scope="module")
def relative_tdn():
    return load_tdn("fast", SensorModel.load("digit_real"))


@pytest.fixture(scope="module")
def digit(another_digit):
    return another_digit(1)


@pytest.fixture(scope="module")
def ball_presses(digit):
    return list(digit.presses(9).values())


@pytest.fixture(scope="module")
def presses(tool, sensor):
    """Images of firm touches and two images of the untouched gel."""
    rng = np.random.default_rng(0)
    sampling = ContactSampling(press=(0.8e-3, 1.5e-3), free_fraction=0.0)
    maps = PenetrationRenderer(tool, sensor).render_with_normals(sample_contact_poses(tool, 8, rng, sensor, sampling))
    plain, optics = np.full((320, 240, 3), (120, 110, 130), np.uint8), TactoOptics(sensor)
    images = [optics.image(p, plain, rng, n) for p, n in zip(*maps, strict=True)]
    nothing = np.zeros((320, 240), np.float32)
    return images, optics.image(nothing, plain, rng), optics.image(nothing, plain, rng)


def test_images_of_a_free_sensor_or_of_another_are_no_touch(tdn, presses):
    images, free, other = presses
    assert not shows_contact(tdn, other, free)
    assert not any(shows_contact(tdn, free, image) for image in images)
    assert not shows_contact(tdn, np.roll(free, 1, axis=2), free)
    tinted = images[0] + np.linspace(-60, 60, 240)[None, :, None] * (1, -1, 0)
    assert not shows_contact(tdn, np.clip(tinted, 0, 255).astype(np.uint8), free)


@pytest.mark.parametrize("gain", [0.85, 1.0, 1.15])
def test_a_touch_is_no_background_at_any_brightness(tdn, presses, gain):
    images, free, _ = presses
    changed = [np.clip(image * gain, 0, 255).astype(np.uint8) for image in images]
    assert np.mean([shows_contact(tdn, image, free) for image in changed]) >= 0.8


def test_real_presses_are_no_backgrounds(shared, relative_tdn):
    """Which of two real images shows the contact; the network has never seen that sensor."""
    presses, free = read_presses(shared / "data/digit_real/ball_presses")
    touched = [presses[f"{i:04d}.png"] for i in range(1, 42, 5)]
    assert np.mean([shows_contact(relative_tdn, image, free) for image in touched]) >= 0.7
    assert np.mean([shows_contact(relative_tdn, free, image) for image in touched]) <= 0.2


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


def test_running_background_comes_at_once_and_forgets_contacts():
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


def judged(relative_tdn, images, background) -> str:
    check = TouchedBackground(relative_tdn, every=1, window=9)
    for image in images:
        check.observe(image, background)
    return check.problem


def test_a_touched_background_is_told_from_a_free_one(relative_tdn, digit, ball_presses):
    for i in (0, 4, 8):
        others = [image for k, image in enumerate(ball_presses) if k != i][:6]
        assert "shows a touch" in judged(relative_tdn, others, ball_presses[i])
    assert "shows a touch" in judged(relative_tdn, [digit.background] * 3, ball_presses[4])  # a finger lifted
    held = digit.image([(120, 160, 1.6e-3)])
    for images in (ball_presses, [held] * 6):
        assert judged(relative_tdn, images, digit.background) == ""


def test_few_images_say_nothing_and_a_new_background_starts_anew(relative_tdn, digit, ball_presses):
    check = TouchedBackground(relative_tdn, every=2, window=9)
    for image in ball_presses[1:5]:
        check.observe(image, ball_presses[8])
    assert check.problem == ""  # only every second counts
    check.observe(ball_presses[5], ball_presses[8])
    assert check.problem
    check.observe(ball_presses[0], digit.background)
    assert check.problem == ""
    for image in ball_presses[1:6]:
        check.observe(image, ball_presses[8])
    assert check.problem
    check.reset()
    assert check.problem == ""
