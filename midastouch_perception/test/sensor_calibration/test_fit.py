import dataclasses

import cv2
import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_calibration.calibration import standard_colours
from midastouch_perception.sensor_calibration.fit import calibrate, turned_doubt
from midastouch_perception.sensor_calibration.response import height_slopes
from midastouch_perception.sensor_model import SensorModel

RADIUS = 3e-3  # m, of the ball that `digit` is pressed with
DIAMETER = 2 * RADIUS
PRESSES = 7


@pytest.fixture(scope="module")
def presses(another_digit):
    return another_digit(6).presses(PRESSES)


@pytest.fixture(scope="module")
def five(presses):
    """As few as can be calibrated from: they show quickly why a calibration is refused."""
    return dict(list(presses.items())[:5])


@pytest.fixture(scope="module")
def result(another_digit, presses, real):
    return calibrate(presses, another_digit(6).background, DIAMETER, real, "D20123")


def test_slopes_of_unseen_presses_become_those_of_the_ball(result):
    figures = result.figures
    assert figures["felt_radius_after"] == pytest.approx(RADIUS, rel=0.12)
    assert abs(figures["felt_radius_after"] - RADIUS) < abs(figures["felt_radius_before"] - RADIUS)
    assert figures["explained_after"] > max(0.8, figures["explained_before"])


def test_what_it_was_made_of_is_written_down(result, real, another_digit):
    made = result.calibration
    assert (made.serial, made.sensor, made.ball_diameter, made.presses) == ("D20123", "digit_real", DIAMETER, PRESSES)
    assert all(not press.problem for press in result.presses)
    made.check_sensor(real, "D20123")
    assert not made.background_problem(another_digit(6).background)


def test_without_a_no_contact_image_one_is_made(digit, presses, real):
    made = calibrate(presses, None, DIAMETER, real)
    found, true = (np.maximum(background.astype(float), 1) for background in (made.background, digit.background))
    found /= np.median(found / true, axis=(0, 1))  # exposure drifts from frame to frame
    assert np.abs(found - true).mean() < 8
    assert made.figures["felt_radius_after"] == pytest.approx(RADIUS, rel=0.15)
    same = {f"{i}.png": digit.image([(115 + 2 * i, 160, 1.6e-3)]) for i in range(6)}
    with pytest.raises(InputError, match=r"background\.png"):  # as they leave no gel free
        calibrate(same, None, DIAMETER, real)


SPOILED = {
    "nothing touches the gel": lambda digit: digit.image([]),
    "two contacts": lambda digit: digit.image([(70, 80, 1.5e-3), (180, 260, 1.5e-3)]),
    "cut off|not one ball": lambda digit: digit.image([(3, 160, 1.5e-3)]),
    "black": lambda digit: np.zeros_like(digit.background),
    "saturated": lambda digit: np.full_like(digit.background, 255),
    "differs everywhere, by": lambda digit: np.roll(digit.background, 60, axis=1),
}


@pytest.fixture(scope="module")
def beside_spoiled(another_digit, presses, real):
    """A calibration from presses among which are images that cannot be used, named by what is wrong with them."""
    digit = another_digit(6)
    spoiled = {said: spoil(digit) for said, spoil in SPOILED.items()}
    return calibrate({**presses, **spoiled}, digit.background, DIAMETER, real)


@pytest.mark.parametrize("said", SPOILED)
def test_images_that_cannot_be_used_are_named_with_the_reason(beside_spoiled, said):
    (bad,) = (press for press in beside_spoiled.presses if press.name == said)
    assert any(reason in bad.problem for reason in said.split("|")), bad.problem
    assert beside_spoiled.calibration.presses >= PRESSES - 1


def test_too_few_usable_presses_are_refused_with_the_reasons(digit, five, real):
    press, rng = digit.image([(120, 160, 1.5e-3)]), np.random.default_rng(0)
    four = dict(list(five.items())[:4])
    again = [np.clip(press + rng.normal(0, 1.5, press.shape), 0, 255).astype(np.uint8) for _ in range(6)]
    corner = [digit.image([(*rng.uniform(45, 105, 2), 1.3e-3)]) for _ in range(8)]
    for images, said in (
        (four, "5 to 40"),
        ({**four, "free.png": digit.image([]), "again.png": digit.image([])}, r"4 of 6 .*free\.png"),
        ({f"again_{i}.png": image for i, image in enumerate(again)}, r"1 of 6 .*again_1\.png"),
        ({f"{i}.png": image for i, image in enumerate(corner)}, r"span .* % of its height.*press all over the gel"),
        ({**five, "small.png": digit.background[::2]}, r"small\.png"),
    ):
        with pytest.raises(InputError, match=said):
            calibrate(images, digit.background, DIAMETER, real)


@pytest.mark.parametrize(
    ("diameter", "said"),
    [
        (0.0, "metres"),
        (6.0, "metres"),
        (0.02, r"13 mm wide.*take a smaller ball"),
        (0.4 * DIAMETER, "diameter"),
        (3 * DIAMETER, "diameter"),
    ],
)
def test_a_wrong_diameter_is_refused(digit, five, real, diameter, said):
    with pytest.raises(InputError, match=said):
        calibrate(five, digit.background, diameter, real)


def test_a_doubtful_diameter_is_refused_unless_confirmed(digit, five, real, monkeypatch):
    monkeypatch.setattr("midastouch_perception.sensor_calibration.fit.measured_radius", lambda *_: RADIUS / 2)
    with pytest.raises(InputError, match=r"about 4 mm.*--diameter-is-right"):
        calibrate(five, digit.background, DIAMETER, real)
    made = calibrate(five, digit.background, DIAMETER, real, diameter_is_right=True)
    assert "about 4 mm" in made.warnings[0]
    monkeypatch.setattr("midastouch_perception.sensor_calibration.fit.turned_doubt", lambda *_: "images are turned")
    made = calibrate(five, digit.background, DIAMETER, dataclasses.replace(real, lamps="gelsight_mini"))
    assert "about 3 mm; images are turned" in made.warnings[0], "under other lamps than a DIGIT's"


def test_presses_not_of_the_no_contact_image_s_gel_are_refused(digit, real):
    rng = np.random.default_rng(0)
    grains = [3 * cv2.GaussianBlur(rng.normal(0, 5, (320, 240)), (0, 0), 1.5)[..., None] for _ in range(2)]
    presses = {
        name: np.clip(image + grains[0], 0, 255).astype(np.uint8) for name, image in digit.presses(PRESSES).items()
    }
    own, other = (np.clip(digit.background + each, 0, 255).astype(np.uint8) for each in grains)
    with pytest.raises(InputError, match=r"of another gel.*capture_background"):
        calibrate(presses, other, DIAMETER, real)
    made = calibrate(presses, own, DIAMETER, real).calibration
    assert not made.background_problem((0.9 * own).astype(np.uint8))
    assert "made with another gel (whose fine texture" in made.background_problem(other)


@pytest.mark.parametrize(
    "wrong", [lambda image: image[..., ::-1], lambda image: image[:, ::-1], lambda image: image[::-1]]
)
def test_turned_or_swapped_images_are_refused(digit, five, real, wrong):
    images = {name: np.ascontiguousarray(wrong(image)) for name, image in five.items()}
    with pytest.raises(InputError, match="rotation and encoding"):
        calibrate(images, np.ascontiguousarray(wrong(digit.background)), DIAMETER, real)


@pytest.mark.parametrize(
    ("spoil", "cause"),
    [
        (lambda digit: digit.image([(120, 160, 2e-3)]), "lift the finger"),
        (lambda digit: np.zeros_like(digit.background), "lights"),
        (lambda digit: np.roll(digit.background, 60, axis=1), rf"of {PRESSES} .*capture it again"),
    ],
)
def test_what_is_wrong_with_the_no_contact_image_is_named(digit, presses, real, spoil, cause):
    with pytest.raises(InputError, match=cause):
        calibrate(presses, spoil(digit), DIAMETER, real)


def test_colours_turned_round_are_noticed_under_known_lamps():
    digit = SensorModel.load("digit_real").for_maps
    penetration = ball_penetration(ball_centre(60, 80, 1.5e-3, 3e-3, digit), 3e-3, digit)
    upright = standard_colours(height_slopes(np.maximum(penetration, 0), digit.pixel_size))
    assert turned_doubt([upright], [penetration], digit) == ""
    assert "rotation and encoding" in turned_doubt([-upright], [penetration], digit)
    assert turned_doubt([-upright], [penetration], dataclasses.replace(digit, lamps="")) == ""
