"""Depth of calibrated sensors, and of scales that the network did not learn with."""

import dataclasses

import numpy as np
import pytest

from midastouch_perception.rendering.renderer import GelShape
from midastouch_perception.sensor_calibration.calibration import Fusion, SensorCalibration, standard_colours
from midastouch_perception.sensor_calibration.response import height_slopes
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_perception.tdn.depth_net import CalibrationInUse
from midastouch_perception.tdn.slope_fusion import joined_depth

DEEP = 1e-3
SOFT = GelShape(0.4e-3, 0.6, 0.2e-3)


def perfect(sensor):
    """A calibration that is not asked, as the colours below are those of the standard sensor."""
    return SensorCalibration(
        "", 6e-3, sensor.name, sensor.pixel_size, np.zeros((12, 6, 2)), np.ones((16, 12, 3)), 10, "2026-11-25T09:00:00"
    )


def pressed(shape, sensor):
    """Penetration (160, 120) float32 m of a block, a ball or a cylinder, `DEEP` at the middle."""
    pixel = sensor.for_maps.pixel_size
    y, x = (np.mgrid[:160, :120] - np.array([79.5, 59.5])[:, None, None]) * pixel
    if shape == "block":
        return np.where((np.abs(x) < 2e-3) & (np.abs(y) < 3e-3), DEEP, 0).astype(np.float32)
    radius, away = (4e-3, np.hypot(x, y)) if shape == "ball" else (3e-3, np.where(np.abs(y) < 5e-3, np.abs(x), np.inf))
    return np.maximum(DEEP - radius + np.sqrt(np.maximum(radius**2 - away**2, 0)), 0).astype(np.float32)


@pytest.mark.parametrize("model", ["digit_real", "gelsight_mini"])
@pytest.mark.parametrize("shape", ["block", "ball", "cylinder"])
def test_what_is_pressed_in_by_a_millimetre_is_a_millimetre_deep(model, shape):
    sensor = SensorModel.load(model)
    tdn, pixel = load_tdn("fast", sensor, perfect(sensor)), sensor.for_maps.pixel_size
    height = SOFT.height(pressed(shape, sensor), pixel)
    felt = tdn.penetration(standard_colours(height_slopes(height, pixel)))
    assert felt[78:82, 58:62].mean() == pytest.approx(DEEP, rel=0.12)
    assert not felt[:10].any()


@pytest.mark.parametrize("calibrated", [False, True])
def test_twice_the_pixels_per_millimetre_is_half_as_deep(calibrated):
    sensor = SensorModel.load("digit_real")
    fine = dataclasses.replace(sensor, focal=2 * sensor.focal)
    seen = standard_colours(height_slopes(pressed("ball", sensor), sensor.for_maps.pixel_size))
    deep = [load_tdn("fast", each, perfect(each) if calibrated else None).penetration(seen) for each in (sensor, fine)]
    assert deep[1].max() == pytest.approx(0.5 * deep[0].max(), rel=0.1)


def test_a_batch_is_felt_as_its_images_are():
    sensor = SensorModel.load("digit_real")
    tdn, pixel = load_tdn("fast", sensor, perfect(sensor)), sensor.for_maps.pixel_size
    seen = np.stack([standard_colours(height_slopes(pressed(each, sensor), pixel)) for each in ("block", "ball")])
    np.testing.assert_allclose(tdn.penetration(seen), [tdn.penetration(each) for each in seen], atol=1e-6)


def test_a_model_s_calibration_serves_sensors_without_their_own():
    mini = SensorModel.load("gelsight_mini")
    tdn = load_tdn("fast", mini)
    assert tdn.calibration_in_use is SensorCalibration.default(mini.at_scale(20e3))
    assert tdn.calibration_in_use is SensorCalibration.default(dataclasses.replace(mini, name="my_mini"))
    assert str(CalibrationInUse(tdn, None, mini)) == "that of the model gelsight_mini"
    tdn.calibration = own = perfect(mini)
    assert tdn.calibration_in_use is own
    for name in ("digit_real", "digit_tacto"):
        assert load_tdn("fast", SensorModel.load(name)).calibration_in_use is None


def test_a_contact_stays_where_the_network_finds_it():
    """Slopes that lead down from the few pixels beside a contact do not take it away."""
    found = np.full((160, 120), DEEP, np.float32)
    found[:3, :3] = 0
    slopes = np.full((160, 120, 2), -0.1, np.float32)
    joined = joined_depth(slopes, found, 0.1e-3, Fusion(0.0, 1))
    assert (joined[found > 0] > 0).all()
    assert joined.max() < 1e-4
