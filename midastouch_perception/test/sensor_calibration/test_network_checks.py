import dataclasses

import numpy as np
import pytest

from midastouch_perception.sensor_calibration.fit import calibrate
from midastouch_perception.sensor_calibration.network_checks import (
    MOST_DIAMETER_FACTOR,
    RADIUS_RATIO,
    depth_errors,
    diameter_doubt,
    gain_doubt,
    measured_radius,
)
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.simulated_digit import PressedSensor

RADIUS = 3e-3  # m, of the ball


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("model", "ratio"), [("digit_real", RADIUS_RATIO), ("gelsight_mini", 1.0)])
def test_a_diameter_that_hardly_fits_is_doubted(way, model, ratio):
    sensor = SensorModel.load(model)
    assert diameter_doubt(ratio * 3e-3, 6e-3 * (0.98 * MOST_DIAMETER_FACTOR) ** way, sensor) == ""
    assert "about 6 mm" in diameter_doubt(ratio * 3e-3, 6e-3 * (1.02 * MOST_DIAMETER_FACTOR) ** way, sensor)


def test_what_is_not_known_is_not_doubted(digit, real):
    assert diameter_doubt(3e-3, 60e-3, dataclasses.replace(real, lamps="")) == ""
    assert measured_radius([digit.background], digit.background, real) is None
    assert diameter_doubt(None, 6e-3, real) == ""


@pytest.mark.parametrize("radius", [2.5e-3, 4e-3])
def test_larger_balls_measure_larger(digit, real, radius):
    sensor = PressedSensor(real, digit.background[None], radius, np.random.default_rng(3))
    measured = measured_radius(list(sensor.presses(4).values()), sensor.background, real)
    assert measured == pytest.approx(RADIUS_RATIO * radius, rel=MOST_DIAMETER_FACTOR - 1)


@pytest.fixture(scope="module")
def digit(another_digit):
    """A sensor that is far from the standard one."""
    return another_digit(10)


@pytest.fixture(scope="module")
def presses(digit):
    return digit.presses(6)


@pytest.fixture(scope="module")
def result(digit, presses, real):
    return calibrate(presses, digit.background, 2 * RADIUS, real)


def test_depth_of_presses_that_were_left_out_is_measured_better(result):
    assert not result.warnings
    assert result.figures["felt_radius_after"] == pytest.approx(RADIUS, rel=0.2)
    assert 0 < result.figures["felt_error_after"] < result.figures["felt_error_before"]


def test_a_calibration_that_misleads_is_warned_of(result, presses, real):
    def misleading(calibration):
        return dataclasses.replace(calibration, coefficients=0.3 * calibration.coefficients)

    spoilt = [misleading(each) for each in result.held_out]
    figures = depth_errors(list(presses.values()), result.penetrations, spoilt, result.background, real)
    assert figures["felt_error_before"] == pytest.approx(result.figures["felt_error_before"])
    assert gain_doubt(figures)
    assert dataclasses.replace(result, figures=result.figures | figures).warnings == [gain_doubt(figures)]
    # slopes of 0.3 times the true ones beside those by the network, which sees colours as weak
    assert figures["curvature_after"] < 0.6 * result.figures["curvature_after"]
    # touches that are not used do not count
    bad = [*presses.values(), np.zeros_like(result.background)]
    figures = depth_errors(bad, [*result.penetrations, None], [*result.held_out, None], result.background, real)
    assert figures["felt_error_after"] == pytest.approx(result.figures["felt_error_after"])
