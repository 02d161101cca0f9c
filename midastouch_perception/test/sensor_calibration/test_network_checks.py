import dataclasses

import cv2
import numpy as np
import pytest

from midastouch_perception.sensor_calibration.fit import calibrate
from midastouch_perception.sensor_calibration.network_checks import (
    MOST_DIAMETER_FACTOR,
    RADIUS_RATIO,
    depth_errors,
    diameter_doubt,
    gain_doubt,
    measured_maps,
    measured_radius,
    radius_doubt,
    stretch_doubt,
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
    maps = measured_maps([digit.background], digit.background, real)
    assert measured_radius(maps, real.for_maps.pixel_size) is None
    assert stretch_doubt(maps) == ""
    assert diameter_doubt(None, 6e-3, real) == ""


@pytest.mark.parametrize("radius", [2.5e-3, 4e-3])
def test_larger_balls_measure_larger(digit, real, radius):
    sensor = PressedSensor(real, digit.background[None], radius, np.random.default_rng(3))
    maps = measured_maps(list(sensor.presses(4).values()), sensor.background, real)
    measured = measured_radius(maps, real.for_maps.pixel_size)
    assert measured == pytest.approx(RADIUS_RATIO * radius, rel=MOST_DIAMETER_FACTOR - 1)


@pytest.mark.parametrize(
    ("wide", "high", "said"), [(1.2, 1, "wider than high"), (1, 1.2, "higher than wide"), (1, 1, "")]
)
def test_stretched_presses_are_doubted(digit, presses, real, wide, high, said):
    """By a camera mode of another shape, for example."""

    def stretched(image):
        about = np.array([[wide, 0, (1 - wide) * 120], [0, high, (1 - high) * 160]], float)
        return cv2.warpAffine(image, about, (240, 320), borderMode=cv2.BORDER_REPLICATE)

    maps = measured_maps([stretched(each) for each in presses.values()], stretched(digit.background), real)
    assert said in stretch_doubt(maps)
    assert bool(said) == bool(stretch_doubt(maps))


@pytest.fixture(scope="module")
def digit(another_digit):
    """A sensor that is far from the standard one."""
    return another_digit(11)


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
        return dataclasses.replace(calibration, coefficients=0.1 * calibration.coefficients, network_weight=0.0)

    spoilt = [misleading(each) for each in result.held_out]
    figures = depth_errors(list(presses.values()), result.penetrations, spoilt, result.background, real)
    assert figures["felt_error_before"] == pytest.approx(result.figures["felt_error_before"])
    assert gain_doubt(figures)
    warnings = [radius_doubt(figures, 2 * RADIUS), gain_doubt(figures)]
    assert all(warnings)
    assert dataclasses.replace(result, figures=result.figures | figures).warnings == warnings
    # slopes of a tenth of the true ones
    assert figures["curvature_after"] < 0.6 * result.figures["curvature_after"]
    # touches that are not used do not count
    bad = [*presses.values(), np.zeros_like(result.background)]
    figures = depth_errors(bad, [*result.penetrations, None], [*result.held_out, None], result.background, real)
    assert figures["felt_error_after"] == pytest.approx(result.figures["felt_error_after"])
