import numpy as np
import pytest

from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.ball_presses import PressedSensor
from midastouch_perception.tdn import load_tdn
from midastouch_perception.tdn.touched_background import TouchedBackground


@pytest.fixture(scope="module")
def tdn():
    return load_tdn("fast", SensorModel.load("digit_real"))


@pytest.fixture(scope="module")
def digit():
    sensor = SensorModel.load("digit_real")
    rows, columns = np.mgrid[-1:1:320j, -1:1:240j]
    lamps = np.stack([110 - 30 * columns, 110 + 30 * columns, 100 + 30 * rows], axis=-1).astype(np.uint8)
    return PressedSensor(sensor, lamps[None], 3e-3, np.random.default_rng(1))


@pytest.fixture(scope="module")
def presses(digit):
    return list(digit.presses(9).values())


def judged(tdn, images, background) -> str:
    check = TouchedBackground(tdn, every=1, window=9)
    for image in images:
        check.observe(image, background)
    return check.problem


def test_touches_elsewhere_give_a_touched_background_away(tdn, presses):
    for i in (0, 4, 8):
        others = [image for k, image in enumerate(presses) if k != i][:6]
        assert "shows a touch" in judged(tdn, others, presses[i])


def test_a_lifted_finger_gives_it_away(tdn, digit, presses):
    assert "shows a touch" in judged(tdn, [digit.background] * 3, presses[4])


def test_a_free_background_is_right_whatever_touches(tdn, digit, presses):
    assert judged(tdn, presses, digit.background) == ""
    held = digit.image([(120, 160, 1.6e-3)])
    assert judged(tdn, [held] * 6, digit.background) == ""


def test_nothing_is_said_of_few_images_and_another_background_is_judged_anew(tdn, digit, presses):
    check = TouchedBackground(tdn, every=2, window=9)
    for image in presses[1:5]:
        check.observe(image, presses[8])
    assert check.problem == ""  # only every second counts
    check.observe(presses[5], presses[8])
    assert check.problem
    check.observe(presses[0], digit.background)
    assert check.problem == ""
    for image in presses[1:6]:
        check.observe(image, presses[8])
    assert check.problem
    check.reset()
    assert check.problem == ""
