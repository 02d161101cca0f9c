import numpy as np
import pytest

from midastouch_perception.ball_calibration.diameter import FELT, SPREAD, diameter_doubt, felt_radius
from midastouch_perception.errors import InputError
from midastouch_perception.simulation.ball_presses import PressedSensor


def test_a_diameter_is_doubted_from_two_deviations_on_and_refused_from_three():
    felt = FELT * 3e-3
    assert diameter_doubt(felt, 6e-3) == ""
    assert diameter_doubt(felt, 6e-3 * np.exp(1.5 * SPREAD)) == ""
    for wrong in (np.exp(2.5 * SPREAD), np.exp(-2.5 * SPREAD)):
        assert "feels like one of about 6 mm" in diameter_doubt(felt, 6e-3 * wrong)
    for wrong in (np.exp(3.5 * SPREAD), np.exp(-3.5 * SPREAD)):
        with pytest.raises(InputError, match="check its diameter"):
            diameter_doubt(felt, 6e-3 * wrong)


def test_nothing_felt_says_nothing(digit, real):
    assert felt_radius([digit.background], digit.background, real) is None
    assert diameter_doubt(None, 6e-3) == ""


@pytest.mark.parametrize("radius", [2.5e-3, 4e-3])
def test_larger_balls_feel_larger(digit, real, radius):
    sensor = PressedSensor(real, digit.background[None], radius, np.random.default_rng(3))
    felt = felt_radius(list(sensor.presses(6).values()), sensor.background, real)
    assert felt == pytest.approx(FELT * radius, rel=np.exp(3 * SPREAD) - 1)
