import json

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_calibration.fit import calibrate
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.optics_fit import fit_optics

DIAMETER = 8e-3


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_real")


def ball(u: float, v: float, contact: float, sensor: SensorModel) -> np.ndarray:
    centre = ball_centre(u * sensor.width, v * sensor.height, contact, DIAMETER / 2, sensor)
    return np.maximum(ball_penetration(centre, DIAMETER / 2, sensor), 0)


def ridge(sensor: SensorModel) -> np.ndarray:
    """A roof 0.6 mm high across the gel, something that no ball is."""
    across = np.abs(np.arange(sensor.width) - 0.5 * sensor.width) * sensor.pixel_size
    roof = np.maximum(0.6e-3 - 0.4 * across, 0).astype(np.float32)
    out = np.zeros((sensor.height, sensor.width), np.float32)
    out[40:-40] = roof
    return out


@pytest.fixture(scope="module")
def optics() -> MeasuredOptics:
    return MeasuredOptics.load("d20641")


def test_presses_tell_the_optics_behind_them(optics, sensor):
    rng, half = np.random.default_rng(0), sensor.for_maps
    camera = MeasuredSensor(optics, sensor, rng)
    places = [(u, v) for u in (0.3, 0.7) for v in (0.2, 0.5, 0.8)]
    presses = np.stack([ball(u, v, rng.uniform(1.8e-3, 2.6e-3), half) for u, v in places])
    images = {f"{i}.png": image for i, image in enumerate(camera.images(presses))}
    found = fit_optics("copy", "test", images, calibrate(images, camera.background, DIAMETER, sensor))
    assert found.explained > 0.8
    true, seen = (each.ratio(ridge(half), half.pixel_size) - 1 for each in (optics, found))
    assert np.square(seen - true).sum() < 0.2 * np.square(true).sum()
    assert 0.5 < found.noise / optics.noise < 1.5


def test_gel_at_rest_shows_no_change_and_colours_saturate(optics, sensor):
    half = sensor.for_maps
    edge = np.zeros((half.height, half.width), np.float32)
    np.testing.assert_allclose(optics.ratio(edge, half.pixel_size), 1, atol=1e-6)
    edge[:, 60:] = 5e-3
    assert optics.ratio(edge, half.pixel_size).max() < 6


def test_images_of_one_seed_are_the_same(optics, sensor):
    maps = np.stack([ridge(sensor.for_maps)] * 2)
    one, other = (list(MeasuredSensor(optics, sensor, np.random.default_rng(3)).images(maps)) for _ in range(2))
    np.testing.assert_array_equal(one, other)
    assert one[0].shape == (sensor.height, sensor.width, 3)
    assert one[0].dtype == np.uint8
    assert (one[0] != one[1]).any()  # noise and light go on


def test_every_shipped_sensor_explains_presses_left_out():
    assert measured_sensors() == ["d20641", "vocdex"]
    for name in measured_sensors():
        assert MeasuredOptics.load(name).explained > 0.7


def test_what_is_saved_is_loaded_and_a_bad_file_named(optics, tmp_path):
    path = tmp_path / "bad.json"
    optics.save(path)
    assert MeasuredOptics.load(path).content_id == optics.content_id
    content = json.loads(path.read_text())
    content["noise"] = None
    for text in ("{}", "no json", json.dumps(content | {"sides": [1.0]}), json.dumps(content)):
        path.write_text(text)
        with pytest.raises(InputError, match=r"bad\.json: .*--optics"):
            MeasuredOptics.load(path)
