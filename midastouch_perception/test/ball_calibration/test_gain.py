import dataclasses

import numpy as np
import pytest

from midastouch_perception.ball_calibration.fit import calibrate
from midastouch_perception.ball_calibration.gain import felt_errors, require_gain
from midastouch_perception.errors import InputError

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
    require_gain(result.figures)
    assert 0 < result.figures["felt_error_after"] < result.figures["felt_error_before"]


def test_a_calibration_that_misleads_is_worth_nothing_and_said_to_be(result, presses, real):
    def misleading(calibration):
        return dataclasses.replace(calibration, coefficients=0.3 * calibration.coefficients)

    spoilt = [misleading(each) for each in result.held_out]
    figures = felt_errors(list(presses.values()), result.penetrations, spoilt, result.background, real)
    assert figures["felt_error_before"] == pytest.approx(result.figures["felt_error_before"])
    with pytest.raises(InputError, match=r"does not help and is not kept: .* mm with it and by .* mm without"):
        require_gain(figures)


def test_touches_that_are_not_used_do_not_count(result, presses, real):
    bad = [*presses.values(), np.zeros_like(result.background)]
    figures = felt_errors(bad, [*result.penetrations, None], [*result.held_out, None], result.background, real)
    assert figures["felt_error_after"] == pytest.approx(result.figures["felt_error_after"])
