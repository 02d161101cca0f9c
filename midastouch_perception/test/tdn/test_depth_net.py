import dataclasses
import re

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.calibration import standard_colours
from midastouch_perception.tdn import load_tdn
from midastouch_perception.tdn.background_store import BackgroundStore
from midastouch_perception.tdn.depth_net import CalibrationInUse


@pytest.fixture(scope="module")
def background():
    rows, columns = np.mgrid[:320, :240]
    return np.stack([60 + columns // 2, 160 - columns // 2, 60 + rows // 4], axis=-1).astype(np.uint8)


@pytest.fixture
def calibration(calibrated, background):
    """Of a sensor twice as colourful as the standard one, in red and green only."""
    coefficients = np.zeros((12, 6, 2))
    coefficients[0, 0] = (-0.25, 0.1)
    coefficients[1, 0] = (0.25, 0.1)
    return calibrated(coefficients, background)


def test_the_network_is_shown_a_standard_sensor(real, background, calibration):
    image = background.astype(float)
    image[100:140, 80:120] *= (1.2, 0.9, 1.0)
    image = image.astype(np.uint8)
    plain = load_tdn("fast", real).difference(image, background)
    tdn = load_tdn("fast", real, calibration=calibration)
    seen = tdn.difference(image, background)
    np.testing.assert_allclose(seen, standard_colours(calibration.response.slopes(plain)), atol=1e-3)
    tdn.calibration = None
    np.testing.assert_array_equal(tdn.difference(image, background), plain)


def test_it_is_used_for_its_own_gel_only(real, background, calibration):
    tdn = load_tdn("fast", real)
    in_use = CalibrationInUse(tdn, calibration, real)
    for _ in range(2):
        in_use.check(background)
        assert tdn.calibration is calibration
        assert str(in_use).startswith("10 presses of a ball of 6 mm")
        in_use.check(background[:, ::-1].copy())
        assert (tdn.calibration, str(in_use)) == (None, "refused")
        assert "another gel" in in_use.problem
    in_use.check(background)
    in_use.refuse("the gel is another one")
    assert (tdn.calibration, in_use.problem, str(in_use)) == (None, "the gel is another one", "refused")


def test_one_of_another_scale_or_sensor_is_not_used(real, background, calibration):
    tdn = load_tdn("fast", real)
    in_use = CalibrationInUse(tdn, dataclasses.replace(calibration, pixel_size=1.05 * real.pixel_size), real)
    in_use.check(background)
    assert (tdn.calibration, str(in_use)) == (None, "refused")
    assert re.search(r"digit_real 18\.50; .*sensor model of your own", in_use.problem)
    with pytest.raises(InputError, match="digit_tacto"):
        load_tdn("fast", calibration=calibration)
    none = CalibrationInUse(None, None, real)
    none.check(background)
    none.refuse("the gel is another one")
    assert (str(none), none.problem) == ("none", "")


def test_it_is_kept_per_serial_number(real, calibration, tmp_path):
    store = BackgroundStore(tmp_path, "D20123")
    assert store.load_calibration(real) is None
    calibration.save(store.calibration_path)
    assert store.load_calibration(real).serial == "D20123"
    dataclasses.replace(calibration, pixel_size=1.05 * real.pixel_size).save(store.calibration_path)
    assert store.load_calibration(real).pixel_size == 1.05 * real.pixel_size
    dataclasses.replace(calibration, serial="D9").save(store.calibration_path)
    with pytest.raises(InputError, match=r"D20123\.calibration\.npz: .*D9"):
        store.load_calibration(real)
