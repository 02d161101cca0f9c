"""How slopes of colours and of the network are joined on a sensor, chosen by its own presses."""

import numpy as np
import pytest

from midastouch_perception.sensor_calibration.calibration import Fusion
from midastouch_perception.sensor_calibration.fit import calibrate, joined_as_measured
from midastouch_perception.sensor_calibration.fusion import CHOICES, DEFAULT, chosen_fusion, fusion_errors

COLOURS, NETWORK = Fusion(0.0, 2), Fusion(1.0, 0)


def errors(best, presses, noise=0.01, seed=4):
    """Errors of presses on which one choice is right, and others are the worse, the further they are from it."""
    rng = np.random.default_rng(seed)
    off = {choice: abs(choice.weight - best.weight) + 0.2 * abs(choice.growth - best.growth) for choice in CHOICES}
    return {choice: np.abs(off[choice] + noise * rng.normal(size=(presses, 3))) for choice in CHOICES}


@pytest.mark.parametrize("best", [COLOURS, NETWORK, DEFAULT])
def test_what_presses_show_clearly_is_chosen(best):
    assert chosen_fusion(errors(best, 10)) == best


def test_presses_that_say_little_leave_the_default():
    chosen = [chosen_fusion(errors(COLOURS, 6, noise=3.0, seed=seed)) for seed in range(40)]
    assert chosen.count(DEFAULT) > 20 > 2 * max(chosen.count(each) for each in CHOICES if each != DEFAULT)


def test_each_press_is_judged_by_what_the_others_chose(digit, real):
    result = calibrate(digit.presses(5), digit.background, 6e-3, real)
    by_colours, by_network = errors(COLOURS, 5), errors(NETWORK, 5)
    mixed = {choice: np.concatenate([by_colours[choice][:3], by_network[choice][3:]]) for choice in CHOICES}
    whole, held_out = joined_as_measured(result.calibration, result.held_out, mixed)
    # two presses of each kind are left to a press of the majority, so its own is not what decides
    assert whole.fusion == held_out[4].fusion == COLOURS != held_out[0].fusion
    np.testing.assert_array_equal(held_out[4].coefficients, result.held_out[4].coefficients)
    # what shows no bump is wrong by all of its depth, whatever is chosen
    blank = fusion_errors([digit.background] * 5, result.penetrations, held_out, digit.background, real)
    assert all(np.isfinite(each).all() and (each[:, 0] > 0.9).all() for each in blank.values())
