import dataclasses

import numpy as np
import pytest

from midastouch_perception.sensor_calibration.fit import calibrate
from midastouch_perception.sensor_calibration.gain import felt_errors, gain_doubt

RADIUS = 3e-3  # m, of the ball


@pytest.fixture(scope="module")
def digit(another_digit):
    """A sensor that is far from the standard one."""
    return another_digit(10)


@pytest.fixture(scope="module")
def presses(digit):
    return digit.presses(10)


@pytest.fixture(scope="module")
def result(digit, presses, real):
    return calibrate(presses, digit.background, 2 * RADIUS, real)


def test_depth_of_presses_that_were_left_out_is_felt_better(result):
    assert not result.warnings
    assert 0 < result.figures["felt_error_after"] < result.figures["felt_error_before"]


def test_a_calibration_that_misleads_is_warned_of(result, presses, real):
    def misleading(calibration):
        return dataclasses.replace(calibration, coefficients=0.3 * calibration.coefficients)

    spoilt = [misleading(each) for each in result.held_out]
    figures = felt_errors(list(presses.values()), result.penetrations, spoilt, result.background, real)
    assert figures["felt_error_before"] == pytest.approx(result.figures["felt_error_before"])
    assert "felt no better with it" in gain_doubt(figures)
    assert dataclasses.replace(result, figures=result.figures | figures).warnings == [gain_doubt(figures)]


def test_touches_that_are_not_used_do_not_count(result, presses, real):
    bad = [*presses.values(), np.zeros_like(result.background)]
    figures = felt_errors(bad, [*result.penetrations, None], [*result.held_out, None], result.background, real)
    assert figures["felt_error_after"] == pytest.approx(result.figures["felt_error_after"])
