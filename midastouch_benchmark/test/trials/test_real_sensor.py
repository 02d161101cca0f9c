import numpy as np
import pytest

from midastouch_benchmark.trials.real_sensor import RealSensorStock
from midastouch_benchmark.trials.stock import SlideKind, Stock
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.touch import reduced_penetration
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.renderer import PenetrationRenderer

SETTINGS = {"sensor": "digit_real", "slides": SlideKind(0.03)}


@pytest.fixture(scope="module")
def tool():
    return ObjectMesh.load(bundled_objects()["handle_tool"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("stock")


def test_a_calibration_brings_what_is_felt_nearer_to_the_truth(tool, folder):
    error = {}
    for calibrated in (False, True):
        stock = RealSensorStock(folder, **SETTINGS, calibrated=calibrated)
        sequence, touches = stock.touches(tool, 0)
        assert touches.made_from["calibrated"] == str(calibrated)
        maps = PenetrationRenderer(tool, stock.networks.sensor.for_maps).render(sequence.poses_true)
        felt = [touch.penetration if touch.in_contact else np.zeros((80, 60), np.float32) for touch in touches.felt]
        off = np.stack(felt) - np.stack([reduced_penetration(each) for each in maps])
        error[calibrated] = float(np.sqrt(np.mean(off**2)))
    assert error[True] < 0.85 * error[False]
    assert error[True] < 1e-4


def test_the_path_is_the_plain_slides(tool, folder):
    plain, real = Stock(folder, **SETTINGS), RealSensorStock(folder, **SETTINGS)
    assert plain.networks.tdn.network_id != real.networks.tdn.network_id
    np.testing.assert_array_equal(plain.slide(tool, 0).poses_measured, real.slide(tool, 0).poses_measured)
    first, again = real.slide(tool, 1), Stock(folder.parent / "again", **SETTINGS).slide(tool, 1)
    np.testing.assert_array_equal(first.image(3), again.image(3), "whichever stock made the slide")
    assert plain.describe() != real.describe()


def test_a_simulators_light_is_refused(folder):
    with pytest.raises(InputError, match=r"sensor digit_tacto: .* use --sensor digit_real"):
        RealSensorStock(folder, sensor="digit_tacto").describe()
