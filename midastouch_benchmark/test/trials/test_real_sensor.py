import numpy as np
import pytest

from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_benchmark.trials.real_sensor import RealSensorCache
from midastouch_common.errors import InputError
from midastouch_filter.core.touch import reduced_penetration
from midastouch_perception.rendering.renderer import PenetrationRenderer

SETTINGS = {"sensor": "digit_real", "slides": SlideKind(0.03)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.mark.slow
def test_a_calibration_brings_what_is_felt_nearer_to_the_truth(tool, folder):
    error = {}
    for calibrated in (False, True):
        cache = RealSensorCache(folder, **SETTINGS, calibrated=calibrated)
        sequence, touches = cache.touches(tool, 0)
        assert cache.describe()["calibrated"] == str(calibrated)
        maps = PenetrationRenderer(tool, cache.networks.sensor.for_maps).render(sequence.poses_true)
        measurement = [
            touch.penetration if touch.in_contact else np.zeros((80, 60), np.float32) for touch in touches.measurements
        ]
        off = np.stack(measurement) - np.stack([reduced_penetration(each) for each in maps])
        error[calibrated] = float(np.sqrt(np.mean(off**2)))
    assert error[True] < 0.85 * error[False]
    assert error[True] < 1e-4


def test_the_path_is_the_plain_slides(tool, folder):
    plain, real = Cache(folder, **SETTINGS), RealSensorCache(folder, **SETTINGS)
    assert plain.networks.tdn.network_id != real.networks.tdn.network_id
    np.testing.assert_array_equal(plain.slide(tool, 0).poses_measured, real.slide(tool, 0).poses_measured)
    first, again = real.slide(tool, 1), Cache(folder.parent / "again", **SETTINGS).slide(tool, 1)
    np.testing.assert_array_equal(first.image(3), again.image(3), "whichever cache made the slide")
    assert plain.describe() != real.describe()


def test_a_simulators_light_is_refused(folder):
    with pytest.raises(InputError, match=r"sensor digit_tacto: .* use --sensor digit_real"):
        RealSensorCache(folder, sensor="digit_tacto").describe()
