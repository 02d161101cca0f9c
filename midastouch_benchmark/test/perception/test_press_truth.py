from types import SimpleNamespace

import numpy as np
import pytest

from midastouch_benchmark.perception import press_truth
from midastouch_benchmark.perception.press_quality import measure_presses
from midastouch_benchmark.perception.press_truth import FittedBall, calibrations_of, held_out_calibrations
from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor
from midastouch_tools.datasets.ball_presses import BallPresses

RADIUS = 4e-3
OFF = 0.5e-3  # m


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_real")


@pytest.fixture(scope="module")
def presses(sensor) -> BallPresses:
    """Presses of known depth, labelled by somebody who is off."""
    rng, half = np.random.default_rng(0), sensor.for_maps
    places = [(u, v) for u in (0.35, 0.65) for v in (0.3, 0.5, 0.7)]
    contacts = rng.uniform(1.8e-3, 2.8e-3, len(places))
    centres = [
        ball_centre(u * half.width, v * half.height, contact, RADIUS, half)
        for (u, v), contact in zip(places, contacts, strict=True)
    ]
    camera = MeasuredSensor(MeasuredOptics.load("d20641"), sensor, rng)
    maps = np.stack([np.maximum(ball_penetration(centre, RADIUS, half), 0) for centre in centres])
    images = {f"{i}.png": image for i, image in enumerate(camera.images(maps))}
    circles = {
        name: (u * sensor.width + OFF / sensor.pixel_size, v * sensor.height, contact / sensor.pixel_size)
        for name, (u, v), contact in zip(images, places, contacts, strict=True)
    }
    return BallPresses(images, camera.background, circles)


def test_labels_that_are_off_are_found_by_the_images(presses, sensor):
    ball = FittedBall(presses, 2 * RADIUS, sensor)
    true = np.array(list(presses.circles.values())) - [OFF / sensor.pixel_size, 0, 0]
    found = np.array([ball.presses.circles[name] for name in presses.images])
    assert np.hypot(*(found - true).T[:2]).max() * sensor.pixel_size < 0.2e-3
    assert np.abs(found[:, 2] / true[:, 2] - 1).max() < 0.06
    by_labels = measure_presses(ball, presses, RADIUS)[1]
    assert 0.35 < by_labels["centre_mm"] < 0.65
    by_itself = measure_presses(ball, ball.presses, RADIUS)[1]
    assert by_itself["centre_mm"] < 0.05
    assert by_itself["rmse_in_circle_mm"] < 0.04
    assert abs(by_itself["peak_ratio"] - 1) < 0.04


@pytest.fixture
def unseen():
    free = np.zeros((320, 240, 3), np.uint8)
    return BallPresses({f"{i}.png": free for i in range(14)}, free, None)


@pytest.fixture
def made_of(monkeypatch):
    """Calibrations that are the names of the presses they were made of."""
    monkeypatch.setattr(
        press_truth, "calibrate", lambda images, *_, **__: SimpleNamespace(calibration=frozenset(images))
    )


def test_no_press_is_judged_with_a_calibration_that_has_seen_it(unseen, made_of):
    found = held_out_calibrations(unseen, 6e-3, None, 10, np.random.default_rng(0))
    assert set(found) == set(unseen.images)
    assert all(len(names) == 10 and name not in names for name, names in found.items())


def test_seeds_repeat(unseen, made_of):
    settings = {"calibrated_with": 8, "seed": 3, "ball_diameter": 6e-3}
    assert calibrations_of(settings, unseen, None) == calibrations_of(settings, unseen, None)
    assert calibrations_of({**settings, "seed": 4}, unseen, None) != calibrations_of(settings, unseen, None)
    assert calibrations_of({"calibration": None, "calibrated_with": None}, unseen, None) is None


@pytest.mark.parametrize("n", [4, 14])
def test_too_few_presses_are_refused(unseen, n):
    with pytest.raises(InputError, match="give from 5 to 13"):
        held_out_calibrations(unseen, 6e-3, None, n, np.random.default_rng(0))
