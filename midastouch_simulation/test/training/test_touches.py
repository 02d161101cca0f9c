import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import ContactSampling, Reachability, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.training.touches import misread, pressed_aside


@pytest.fixture(scope="module")
def presses() -> np.ndarray:
    """One press of a ball, many times."""
    sensor = SensorModel.load("digit_tacto").for_maps
    centre = ball_centre(sensor.width / 2, sensor.height / 2, 2e-3, 4e-3, sensor)
    press = np.maximum(ball_penetration(centre, 4e-3, sensor), 0).astype(np.float32)
    return np.repeat(press[None], 200, axis=0)


def test_half_of_the_touches_stay_and_a_quarter_are_only_scaled(presses):
    before = presses.copy()
    measured = misread(presses, np.random.default_rng(0))
    np.testing.assert_array_equal(presses, before)
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


def test_half_of_the_touches_are_anywhere_in_view_light_or_firm():
    mesh, sensor = ObjectMesh.load(bundled_objects()["eyebolt"]), SensorModel.load("digit_tacto").for_maps
    rng = np.random.default_rng(0)
    before = sample_contact_poses(mesh, 300, rng, sensor, ContactSampling(free_fraction=0))
    after = pressed_aside(before, Reachability(mesh, sensor), sensor, rng)
    moved = np.flatnonzero(np.abs(after - before).max(axis=(1, 2)) > 0)
    assert 0.25 < len(moved) / len(before) < 0.55  # some of the moved ones touch nothing there
    maps = PenetrationRenderer(mesh, sensor).render(after[moved])
    deepest = maps.max(axis=(1, 2))
    assert (deepest > 0).all()
    assert deepest.max() < 1.7e-3
    assert np.median(deepest) == pytest.approx(np.sqrt(0.05e-3 * 1.5e-3), rel=0.5)
    row, column = np.unravel_index(maps.reshape(len(maps), -1).argmax(axis=1), maps.shape[1:])
    for at, size in (row, sensor.height), (column, sensor.width):
        quarters = np.histogram(at, 4, (0, size))[0] / len(at)
        assert quarters.min() > 0.1, "deepest anywhere, at the borders too"
