import cv2
import numpy as np
import pytest

from midastouch_perception.tdn.colour_layout import (
    ORIENTATIONS,
    colour_layout,
    exposure_problem,
    image_problem,
    misorientation,
    shipped_layout,
    turned_since,
)


def digit(gain: float = 1.0) -> np.ndarray:
    """Untouched gel (320, 240, 3) lit red from the left, green from the right, blue from below."""
    y, x = np.mgrid[1:-1:320j, -1:1:240j]
    lobes = [np.exp(-((x + 0.7) ** 2)), np.exp(-((x - 0.7) ** 2)), np.exp(-((y + 0.9) ** 2)) * 0.9]
    return np.clip(gain * (60 + 80 * np.stack(lobes, axis=-1)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("gain", [0.3, 1.0, 1.4])
def test_a_digit_as_it_should_be(gain):
    assert image_problem(digit(gain), shipped_layout()) == ""


@pytest.mark.parametrize(
    ("name", "fix"),
    [
        ("upside down", "rotation"),
        ("mirrored left to right", "rotation"),
        ("with red and blue swapped", ""),  # "encoding", but see below
        ("mirrored left to right and with red and blue swapped", "rotation and encoding"),
    ],
)
def test_wrong_orientations_are_named_with_the_fix(name, fix):
    said = image_problem(np.ascontiguousarray(ORIENTATIONS[name](digit())), shipped_layout())
    assert "the images look " in said
    assert f"check the driver's {fix}" in said
    if name != "with red and blue swapped":  # blue is the faintest: it may pass for another mistake
        assert name in said


@pytest.mark.parametrize("name", ORIENTATIONS)
def test_what_was_turned_since_the_no_contact_image_is_named(name):
    """Against the sensor's own no-contact image every mistake is distinguished from every other, through a touch."""
    touched = cv2.circle(digit(), (120, 160), 45, (140, 100, 80), -1)
    assert turned_since(touched, digit()) == ""
    wrong = np.ascontiguousarray(ORIENTATIONS[name](touched))
    assert f"look {name} against" in turned_since(wrong, digit())
    assert "capture_background" in turned_since(wrong, digit())


def test_grey_is_not_judged_unless_too_dark_or_bright():
    for level, said in ((100, ""), (0, "black"), (255, "saturated")):
        grey = np.full((320, 240, 3), level, np.uint8)
        found = image_problem(grey, shipped_layout())
        assert said in found
        assert bool(found) == bool(said)
        assert not colour_layout(grey).any()
    image = digit()
    image[:80] = 255
    assert exposure_problem(image, most=0.5) == ""
    assert "saturated (2" in exposure_problem(image, most=0.2)


def test_a_real_digit_that_is_not_in_the_mean(shared):
    for folder in ("ball_presses", "sphere_presses_d20641"):
        image = cv2.imread(str(shared / f"data/digit_real/{folder}/background.png"))[:, :, ::-1]
        assert image_problem(image, shipped_layout()) == ""
        for name, make in ORIENTATIONS.items():
            found = misorientation(np.ascontiguousarray(make(image)), shipped_layout())
            # what is turned and swapped may be taken for a sensor that is lit so, but not for another mistake
            assert found == name or (not found and name.startswith("mirrored top"))
