import numpy as np
import pytest

from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_calibration.response import height_slopes
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.gel_light import DESIGNS, DIGIT_DESIGN, GelLight, LampDesign


@pytest.mark.parametrize("seed", range(6))
def test_each_colour_is_brighter_where_the_ball_faces_its_light(real, cap, seed):
    light = GelLight(real, np.random.default_rng(seed))
    np.testing.assert_allclose(light.ratio(np.zeros((160, 120), np.float32)), 1, atol=1e-5)
    ratio = light.ratio(cap)
    assert np.isfinite(ratio).all()
    assert ratio.min() > 0
    v, u = np.mgrid[:160, :120] - np.array([80, 60])[:, None, None]
    inside = np.where(cap > 0, 1.0, 0.0)
    right = [(ratio[..., c] * u * inside).sum() for c in range(3)]
    up = [(ratio[..., c] * -v * inside).sum() for c in range(3)]
    assert right[0] > right[1], "red comes from the right, green from the left"
    assert up[2] < min(up[:2]), "blue from below"


def test_higher_gel_shades_the_gel_behind_it(real, cap):
    far = (cap == 0) & (np.hypot(*(np.mgrid[:160, :120] - np.array([80, 60])[:, None, None])) > 22)
    dark = [GelLight(real, np.random.default_rng(seed)).ratio(cap)[far].min() for seed in range(10)]
    assert min(dark) < 0.85
    assert max(dark) <= 1.0
    assert np.ptp(dark) > 0.01, "sensors differ"
    np.testing.assert_array_equal(*(GelLight(real, np.random.default_rng(0)).ratio(cap) for _ in range(2)))


def test_lamps_of_another_design_shine_from_where_it_has_them(real, cap):
    """A design turned by half a turn darkens where the DIGIT's brightens; both leave flat gel alone."""
    turned = LampDesign(np.radians([210.0, 330.0, 90.0]), np.arange(3))
    digit, other = (GelLight(real, np.random.default_rng(3), *design).ratio(cap) - 1 for design in ((), (turned,)))
    inside = cap > 0
    for colour in range(3):
        assert np.corrcoef(digit[inside, colour], other[inside, colour])[0, 1] < -0.5


@pytest.mark.parametrize("seed", range(4))
def test_a_random_design_has_every_colour(real, cap, seed):
    rng = np.random.default_rng(seed)
    design = LampDesign.random(rng)
    assert set(design.colours) == {0, 1, 2}
    assert 3 <= len(design.angles) <= 5
    light = GelLight(real, rng, design)
    np.testing.assert_allclose(light.ratio(np.zeros((160, 120), np.float32)), 1, atol=1e-5)
    assert light.ratio(cap).std() > 0.02


def test_a_calibration_of_its_kind_reads_a_simulated_mini(cap):
    """The slopes of a GelSight Mini under its own lamps, but not under those of a DIGIT."""
    mini = SensorModel.load("gelsight_mini").for_maps
    calibration, truth = SensorCalibration.default(mini), height_slopes(cap, mini.pixel_size)[cap > 0]

    def likeness(design):
        changes = [100 * (GelLight(mini, np.random.default_rng(seed), design).ratio(cap) - 1) for seed in range(6)]
        found = [calibration.response.slopes(change)[cap > 0] for change in changes]
        return np.median([np.corrcoef(slopes.ravel(), truth.ravel())[0, 1] for slopes in found])

    assert likeness(DESIGNS[mini.lamps]) > 0.6
    assert likeness(DIGIT_DESIGN) < 0.4
