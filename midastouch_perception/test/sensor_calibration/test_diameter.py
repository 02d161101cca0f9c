import numpy as np
import pytest

from midastouch_perception.sensor_calibration.diameter import DOUBT, FELT, diameter_doubt, felt_radius
from midastouch_perception.simulation.ball_presses import PressedSensor


@pytest.mark.parametrize("way", [1, -1])
def test_a_diameter_that_hardly_fits_is_doubted(way):
    felt = FELT * 3e-3
    assert diameter_doubt(felt, 6e-3 * (0.98 * DOUBT) ** way) == ""
    assert "feels like one of about 6 mm" in diameter_doubt(felt, 6e-3 * (1.02 * DOUBT) ** way)


def test_nothing_felt_says_nothing(digit, real):
    assert felt_radius([digit.background], digit.background, real) is None
    assert diameter_doubt(None, 6e-3) == ""


@pytest.mark.parametrize("radius", [2.5e-3, 4e-3])
def test_larger_balls_feel_larger(digit, real, radius):
    sensor = PressedSensor(real, digit.background[None], radius, np.random.default_rng(3))
    felt = felt_radius(list(sensor.presses(6).values()), sensor.background, real)
    assert felt == pytest.approx(FELT * radius, rel=DOUBT - 1)
