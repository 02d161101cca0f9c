"""Forces with a bias, a weight, and what no image explains."""

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_motion.control.wrench import ForceModel, Sample, Wrench

G = 9.81
UP = np.array([0.0, 0.0, 1.0])
MODEL = ForceModel(margin=4.0)
SHALLOW = 2e-8  # m^3: 2 N of gel


def felt(wrench, force, displaced=0.0, slope=0.0, up=UP, start=10.0):
    """Its judgement after 0.2 s of a force (3,), as measured."""
    for k in range(20):
        wrench.take(Sample(start + 0.01 * k, np.array(force, float), up))
    return wrench.compared(displaced, slope)


def tared(bias=(0.0, 0.0, 0.0), model=MODEL, up=UP):
    wrench = Wrench(model)
    felt(wrench, bias, up=up, start=0.0)
    wrench.tare()
    return wrench


def test_a_bias_is_taken_off_and_nothing_is_judged_before():
    wrench = Wrench(MODEL)
    assert "none comes" in wrench.describe()["force"]
    assert not felt(wrench, [9.0, 0, 0]).problem
    wrench = tared([3.0, 0.0, -4.0])
    assert not wrench.compared(0.0, 0.0).problem
    assert not felt(wrench, [3.0, 0.0, -3.0], SHALLOW).problem
    np.testing.assert_allclose(wrench.force, [0.0, 0.0, 1.0], atol=1e-9)
    assert "bias 5.0 N" in wrench.describe()["force"]


@pytest.mark.parametrize(
    ("force", "displaced", "slope", "reason", "sure"),
    [
        ([0.0, 0.0, 3.0], 0.0, 0.0, "", True),
        ([0.0, 0.0, 5.0], SHALLOW, 0.0, "", True),
        ([7.0, 0.0, 5.0], SHALLOW, 0.0, "", True),  # of friction, over a rough surface
        ([0.0, 0.0, 7.0], SHALLOW, 0.0, "of which its depth explains 2.0: its rim touches something", False),
        ([0.0, 6.0, 1.0], SHALLOW, 0.0, "6.0 N across the gel and 1.0 onto it", True),
        ([7.5, 0.0, 2.5], SHALLOW, 0.0, "7.5 N across", True),
        ([7.5, 0.0, 2.5], SHALLOW, 0.4, "", True),  # down a slope
        ([0.0, 0.0, 5.0], 0.0, 0.0, "no image shows a contact: something touches beside the gel", False),
        ([5.0, 0.0, 0.0], 0.0, 0.0, "no image shows a contact", True),
        ([0.0, 0.0, -5.0], 0.0, 0.0, "no image shows a contact", True),
        ([0.0, 0.0, -2.0], 3e-8, 0.0, "but it is pressed: the sign or the frame of the wrench is wrong", True),
        ([0.0, 0.0, -0.5], 3e-8, 0.0, "", True),
    ],
)
def test_a_force_that_the_depth_does_not_explain(force, displaced, slope, reason, sure):
    found = felt(tared(), force, displaced, slope)
    assert (reason in found.problem) if reason else found.problem == ""
    assert found.sure == sure


def test_the_weight_of_a_tool_is_taken_off_and_weighed_by_a_turn():
    down, aside = UP, np.array([1.0, 0.0, 0.0])
    bias, mass = np.array([1.0, 2.0, 3.0]), 1.5
    wrench = tared(bias - mass * G * down, ForceModel(mass))
    assert wrench.mass is None
    assert not felt(wrench, bias - mass * G * aside, up=aside).problem
    wrench.tare()
    assert wrench.mass == pytest.approx(mass)
    unweighed = tared(bias - mass * G * down)
    assert "tool_mass is wrong" in felt(unweighed, bias - mass * G * aside, up=aside).problem
    unweighed.tare()
    found = felt(unweighed, [30, 0, 0], up=aside, start=20.0)
    assert "tool_mass is wrong, 1.50 kg by turns in the air" in found.problem


def test_small_turns_do_not_weigh_a_tool():
    wrench = tared()
    for k in range(1, 40):
        felt(wrench, [0, 0, 0], up=se3.exp(np.array([0, 0, 0, 0.01 * k % 0.2, 0, 0]))[2, :3], start=10.0 * k)
        wrench.tare()
    assert wrench.mass is None


def test_a_few_samples_are_no_bias():
    wrench = Wrench(MODEL)
    assert wrench.tare() == "", "an arm without forces"
    for stamp in (0.0, 0.01, 1.0):
        wrench.take(Sample(stamp, np.ones(3), UP))
    assert "their bias is not known" in wrench.tare()
    assert "bias unknown" in wrench.describe()["force"]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"mass": -0.1}, "tool mass: -0.1 kg is not between 0 and 20"),
        ({"mass": 21.0}, "tool mass: 21 kg"),
        ({"mass": float("nan")}, "tool mass: nan kg"),
        ({"stiffness": 0.0}, "stiffness of forces: 0"),
        ({"margin": float("inf")}, "margin of forces: inf"),
    ],
)
def test_a_model_that_cannot_be_is_refused(values, reason):
    with pytest.raises(InputError, match=reason):
        ForceModel(**values)
