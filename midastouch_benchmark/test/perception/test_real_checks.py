import numpy as np
import pytest

from midastouch_benchmark.perception import diameter_checks as diameters
from midastouch_benchmark.perception.diameter_checks import FACTORS, diameter_checks
from midastouch_benchmark.perception.real_checks import real_checks
from midastouch_bringup.datasets.ball_presses import BallPresses
from midastouch_bringup.datasets.slide_simulation import no_contact_image
from midastouch_perception.sensor_calibration.network_checks import RADIUS_RATIO
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.simulated_digit import PressedSensor
from midastouch_perception.tdn import load_tdn


@pytest.fixture(scope="module")
def real():
    return SensorModel.load("digit_real")


def test_alarms_are_counted_with_the_right_and_with_a_touched_background(real):
    rng = np.random.default_rng(7)
    digit = PressedSensor(real, no_contact_image(real, rng)[None], 3e-3, rng)
    presses = BallPresses(digit.presses(8), digit.background, None)
    counted = real_checks(load_tdn("fast", real), presses, rng)
    assert counted["trials"] == 16
    assert counted["right"] <= 0.1
    assert counted["touched"] >= 0.7


def test_doubts_are_counted_by_factor(real, monkeypatch):
    truth = iter(np.random.default_rng(0).uniform(0.98, 1.02, 3) * RADIUS_RATIO * 3e-3)
    monkeypatch.setattr(diameters, "measured_radius", lambda *_: next(truth))
    monkeypatch.setattr(diameters, "RADII", (3e-3, 3e-3))
    rng = np.random.default_rng(0)
    counted = diameter_checks(real, no_contact_image(real, rng)[None], 3, rng)
    assert counted["felt_over_true"] == pytest.approx(RADIUS_RATIO, rel=0.02)
    assert counted["spread"] < 0.03
    given = {each["factor"]: each for each in counted["given"]}
    assert set(given) == set(FACTORS)
    assert given[1.0] == {"factor": 1.0, "doubted": 0}
    assert given[2.0]["doubted"] == given[0.5]["doubted"] == 1
