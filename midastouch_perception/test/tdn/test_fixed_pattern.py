"""Images that are rolled, turned or swapped against their no-contact image are named, with the fix."""

import cv2
import numpy as np
import pytest

from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.colour_layout import ORIENTATIONS
from midastouch_perception.tdn.fixed_pattern import PatternCheck, pattern_problem, rolled_problem
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_tools.datasets.ball_presses import read_presses

TURNS = [name for name in ORIENTATIONS if "swapped" not in name]


def grained(seed: int = 0) -> np.ndarray:
    """A no-contact image (320, 240, 3) with the grains of a gel."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-1:1:320j, -1:1:240j]
    light = np.stack([90 - 40 * x, 90 + 40 * x, 80 + 20 * y], axis=-1)
    grains = cv2.GaussianBlur(rng.normal(0, 1, (320, 240)), (0, 0), 1.5)
    return noisy(light + 2.5 * (grains / grains.std())[..., None], rng)


def noisy(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.clip(np.rint(image + rng.normal(0, 1.5, image.shape)), 0, 255).astype(np.uint8)


def pressed(image: np.ndarray, seed: int = 1) -> np.ndarray:
    """The image with a soft contact on a third of it."""
    y, x = np.mgrid[0:320, 0:240]
    across, down = (x - 90) / 50, (y - 180) / 60
    bump = np.exp(-(across**2) - down**2)
    return noisy(
        image * (1 + 0.8 * np.stack([bump * across, -bump * across, bump * down], -1)), np.random.default_rng(seed)
    )


@pytest.mark.parametrize(
    "touch", [lambda image: noisy(image, np.random.default_rng(1)), pressed], ids=["free", "touched"]
)
@pytest.mark.parametrize(
    ("axis", "by", "said"),
    [(1, 20, "20 px right"), (1, 80, "80 px right"), (1, 200, "40 px left"), (0, 100, "100 px down")],
)
def test_what_is_rolled_is_named_with_the_way(touch, axis, by, said):
    background = grained()
    image = touch(background)
    assert pattern_problem(image, background) == ""
    problem = pattern_problem(np.roll(image, by, axis), background)
    assert f"are rolled by {said}" in problem
    assert "plug the sensor in again" in problem


@pytest.mark.parametrize("name", TURNS)
def test_what_is_turned_is_named_by_its_pattern(name):
    background = grained()
    grey = np.repeat(background.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8)
    for reference in (background, grey):  # colours alone would do for the first
        problem = pattern_problem(np.ascontiguousarray(ORIENTATIONS[name](pressed(reference))), reference)
        assert f"look {name} against" in problem
        assert "rotation" in problem


def test_swapped_colours_are_named():
    background = grained()
    assert "red and blue swapped" in pattern_problem(pressed(background)[..., ::-1].copy(), background)


def test_another_gel_and_plain_images_are_not_judged():
    assert pattern_problem(pressed(grained(5)), grained(6)) == ""
    for level in (0, 100):
        plain = np.full((320, 240, 3), level, np.uint8)
        assert pattern_problem(plain, plain) == ""


@pytest.mark.parametrize("name", measured_sensors())
def test_measured_sensors_are_never_refused(name):
    """Through exposure, drift and contacts that cover half of the view."""
    sensor = SensorModel.load("digit_real")
    camera = MeasuredSensor(MeasuredOptics.load(name), sensor, np.random.default_rng(0))
    y, x = np.mgrid[0:160, 0:120]
    maps = np.stack([np.maximum(1e-3 - ((x - 60) ** 2 + (y - row) ** 2) * 2.5e-7, 0) for row in range(0, 160, 8)])
    assert {pattern_problem(image, camera.background) for image in camera.images(maps.astype(np.float32))} == {""}


def said(check, image, background):
    return getattr(check.refusal(image, background), "reason", "")


def test_a_stream_is_judged_at_once_and_believed_again_soon():
    background, check = grained(), PatternCheck()
    rolled = np.roll(background, 60, axis=1)
    assert "rolled" in said(check, rolled, background)
    assert "rolled" in said(check, background, background), "not every image is compared"
    assert [said(check, background, background) for _ in range(10)][-1] == ""
    assert any(said(check, rolled, background) for _ in range(40))
    assert said(check, background, background.copy()) == "", "a new no-contact image is compared with at once"


def test_a_rolled_no_contact_image_is_named_and_its_images_are_not_used():
    background = grained()
    assert rolled_problem(background) == ""
    rolled = np.roll(background, 80, axis=1)
    assert "a seam at column 80" in rolled_problem(rolled)
    assert "a seam at column 80" in said(PatternCheck(), np.roll(pressed(background), 80, axis=1), rolled)


@pytest.mark.parametrize(
    "folder", ["digit_real/sphere_presses_d20641", "digit_real/ball_presses", "gelsight_mini/presses_9500"]
)
def test_presses_of_real_sensors(shared, folder):
    presses, background = read_presses(shared / "data" / folder)
    assert rolled_problem(background) == ""
    for press in list(presses.values())[::4]:
        assert pattern_problem(press, background) == ""
        for by in (20, 80, 200):
            assert "are rolled by" in pattern_problem(np.roll(press, by, axis=1), background)
        for name in TURNS:
            assert f"look {name} against" in pattern_problem(
                np.ascontiguousarray(ORIENTATIONS[name](press)), background
            )
