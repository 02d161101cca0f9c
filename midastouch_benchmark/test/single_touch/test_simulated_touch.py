from types import SimpleNamespace

import numpy as np
import pytest

from midastouch_benchmark.single_touch.simulated_touch import Lighting, TouchSimulator
from midastouch_common.errors import InputError
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.fcrn import FcrnDepthNet


class BrightnessTdn:
    """A pixel that differs by `threshold` grey levels is pressed in by 1 mm."""

    def __init__(self, threshold: float = 6.0):
        self._threshold = threshold

    def penetration(self, difference: np.ndarray) -> np.ndarray:
        return 1e-3 * (np.abs(difference).max(axis=-1) > self._threshold).astype(np.float32)


class WholeImages(FcrnDepthNet):
    """In FCRN's place: keeps what it is shown, and feels everything."""

    def __init__(self):
        self.shown = []

    def predict(self, image, background, difference=None):
        self.shown.append(image)
        return np.full((160, 120), 1e-3, np.float32)


def networks(threshold: float = 6.0) -> SimpleNamespace:
    return SimpleNamespace(tdn=BrightnessTdn(threshold), sensor=SensorModel.load("digit_tacto"))


@pytest.fixture(scope="module")
def poses(mesh) -> np.ndarray:
    sampling = ContactSampling(free_fraction=0.0)
    return sample_contact_poses(mesh, 25, np.random.default_rng(0), SensorModel.load("digit_tacto"), sampling)


@pytest.mark.parametrize("kind", ["tacto", "random"])
def test_touches_are_seen_and_their_codes_repeat_with_the_seed(kind, mesh, poses):
    simulator = TouchSimulator(mesh, networks(), Lighting(kind))
    seen = []

    def encode(penetration):
        seen.append(penetration)
        area = penetration.reshape(len(penetration), -1).sum(axis=1)
        return np.stack([np.cos(area), np.sin(area)], axis=1)

    tcn = SimpleNamespace(encode=encode)
    codes, in_contact = simulator.encode(poses, tcn, np.random.default_rng(1))
    assert [len(each) for each in seen] == [20, 5]
    assert in_contact.mean() > 0.8
    np.testing.assert_array_equal(codes, simulator.encode(poses, tcn, np.random.default_rng(1))[0])
    # two sensors, two no-contact images; the images themselves differ from them by what is touched
    assert 0.02 < (seen[0] > 0).mean() < 0.7


def test_given_backgrounds_are_used(mesh):
    bright = np.full((3, 160, 120, 3), 200, np.uint8)
    drawn = Lighting("tacto", bright).draw_background(
        SensorModel.load("digit_tacto").scaled(0.5), np.random.default_rng(0)
    )
    np.testing.assert_array_equal(drawn, bright[0])


def test_a_touch_that_is_not_felt_has_a_random_code(mesh, poses):
    away = poses.copy()
    away[::2, :3, 3] += 0.05 * away[::2, :3, 2]
    simulator = TouchSimulator(mesh, networks(), Lighting())
    tcn = SimpleNamespace(encode=lambda maps: np.ones((len(maps), 8)) / np.sqrt(8))
    codes, in_contact = simulator.encode(away, tcn, np.random.default_rng(0))
    assert not in_contact[::2].any()
    assert np.linalg.norm(codes, axis=1) == pytest.approx(1)
    assert len(np.unique(codes[~in_contact], axis=0)) == (~in_contact).sum()
    assert len(np.unique(codes[in_contact], axis=0)) == 1


def test_fcrn_is_shown_whole_camera_images(mesh, poses):
    tdn = WholeImages()
    simulator = TouchSimulator(mesh, SimpleNamespace(tdn=tdn, sensor=networks().sensor), Lighting("random"))
    (percepts,) = simulator.percepts(poses[:3], np.random.default_rng(0))
    assert [(image.shape, image.dtype) for image in tdn.shown] == 3 * [((320, 240, 3), np.uint8)]
    assert percepts.in_contact.all()


def test_networks_that_feel_nothing_are_refused(mesh, poses):
    simulator = TouchSimulator(mesh, networks(threshold=300), Lighting())
    with pytest.raises(InputError, match="block: 0 of 25 touches"):
        simulator.encode(poses, SimpleNamespace(encode=lambda maps: np.ones((len(maps), 1))), np.random.default_rng(0))
