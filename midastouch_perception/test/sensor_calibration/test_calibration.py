import contextlib
import dataclasses

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, plain_slopes, standard_colours
from midastouch_perception.sensor_model import SensorModel


@pytest.fixture
def background():
    return np.random.default_rng(0).uniform(60, 150, (20, 15, 3)).repeat(16, 0).repeat(16, 1).astype(np.uint8)


@pytest.fixture
def calibration(calibrated, background):
    return calibrated(np.random.default_rng(1).normal(0, 0.1, (12, 6, 2)), background)


def test_it_comes_back_from_its_file(calibration, tmp_path):
    calibration = dataclasses.replace(calibration, network_weight=0.25, outline_growth=2)
    calibration.save(tmp_path / "a.npz")
    again = SensorCalibration.load(tmp_path / "a.npz")
    assert again.fusion == (0.25, 2)
    for field in dataclasses.fields(calibration):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(calibration, field.name))


def test_a_file_of_the_format_before_is_joined_as_by_default(calibration, tmp_path):
    calibration.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        values = {name: file[name] for name in file.files if name not in ("network_weight", "outline_growth")}
    np.savez(tmp_path / "b.npz", **values | {"format": 3})
    assert SensorCalibration.load(tmp_path / "b.npz").fusion == calibration.fusion


def test_broken_files_are_refused(calibration, tmp_path):
    path = tmp_path / "a.npz"
    for content in (b"", b"PK\x03\x04 cut", b"not an archive"):
        path.write_bytes(content)
        with pytest.raises(InputError, match="not a calibration"):
            SensorCalibration.load(path)
    calibration.save(path)
    sound = path.read_bytes()
    for at in range(0, len(sound), 29):  # refused, or it comes back
        path.write_bytes(sound[:at] + bytes([sound[at] ^ 0xFF]) + sound[at + 1 :])
        with contextlib.suppress(InputError):
            SensorCalibration.load(path)
    with pytest.raises(InputError, match="no such calibration file"):
        SensorCalibration.load(tmp_path / "none.npz")
    nan = np.full((12, 6, 2), np.nan)  # no ball: as from touches of an object, formerly
    for change, said in (
        ({"coefficients": nan}, "not a calibration"),
        ({"ball_diameter": 0.0}, "ball_diameter 0"),
        ({"network_weight": 1.5}, "network_weight 1.5"),
    ):
        dataclasses.replace(calibration, **change).save(path)
        with pytest.raises(InputError, match=said):
            SensorCalibration.load(path)


def test_another_sensor_or_scale_is_refused(calibration, real):
    calibration.check_sensor(real, "D20123")
    mine = dataclasses.replace(calibration, sensor="mine")
    for made, sensor, serial, said in (
        (calibration, real, "D9", r"D20123.*D9"),
        (calibration, SensorModel.load("digit_tacto"), "", "digit_tacto"),
        (calibration, dataclasses.replace(real, focal=1.1 * real.focal), "", "px/mm"),
        (calibration, dataclasses.replace(real, name="mine"), "", r"model digit_real, .* --sensor mine\.yaml$"),
        (mine, real, "", r"model mine\.yaml, .* --sensor digit_real$"),
    ):
        with pytest.raises(InputError, match=said):
            made.check_sensor(sensor, serial)


def test_another_gel_is_noticed_and_another_brightness_is_not(calibration, background):
    assert not calibration.background_problem(background)
    assert not calibration.background_problem((0.8 * background).astype(np.uint8))
    assert "another gel" in calibration.background_problem(background[:, ::-1].copy())


def test_standard_colours_cancel_and_give_back_the_slopes():
    slopes = np.random.default_rng(0).normal(0, 0.4, (7, 5, 2)).astype(np.float32)
    colours = standard_colours(slopes)
    np.testing.assert_allclose(colours.sum(axis=-1), 0, atol=1e-3)
    np.testing.assert_allclose(plain_slopes(colours), slopes, atol=1e-5)
