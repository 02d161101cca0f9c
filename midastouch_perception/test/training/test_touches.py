import numpy as np
import pytest

from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.training.touches import misread


@pytest.fixture(scope="module")
def presses() -> np.ndarray:
    """One press of a ball, many times."""
    sensor = SensorModel.load("digit_tacto").for_maps
    centre = ball_centre(sensor.width / 2, sensor.height / 2, 2e-3, 4e-3, sensor)
    press = np.maximum(ball_penetration(centre, 4e-3, sensor), 0).astype(np.float32)
    return np.repeat(press[None], 200, axis=0)


def test_half_of_the_touches_stay_and_of_the_others_half_are_only_scaled(presses):
    measured = misread(presses, np.random.default_rng(0))
    touched = presses[0] > 0
    ratio = measured[:, touched] / presses[0, touched]
    only_scaled = np.ptp(ratio, axis=1) < 1e-4
    same = only_scaled & (np.abs(ratio[:, 0] - 1) < 1e-6)
    scale = ratio[only_scaled & ~same, 0]
    assert 0.4 < same.mean() < 0.6
    assert 0.17 < len(scale) / len(presses) < 0.33
    assert 0.7 - 1e-6 < scale.min() < 0.8
    assert 1.25 < scale.max() < 1.4 + 1e-6
    # the outlines of the rest grow or shrink, and none is lost
    area = np.count_nonzero(measured, axis=(1, 2)) / np.count_nonzero(touched)
    assert (area[only_scaled] == 1).all()
    assert 0.5 < area.min() < 0.97
    assert 1.03 < area.max() < 2


def test_given_maps_are_left_as_they_are(presses):
    before = presses.copy()
    misread(presses, np.random.default_rng(0))
    assert np.array_equal(presses, before)
