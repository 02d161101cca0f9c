import numpy as np
import pytest

from midastouch_perception.contact import ContactDetector
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.simulated_digit import SimulatedDigit

AWAY = np.eye(4)
AWAY[2, 3] = 1.0


@pytest.fixture(params=["digit_tacto", "digit_real"])
def model(request):
    return SensorModel.load(request.param)


@pytest.fixture
def grey(model):
    return np.full((model.height, model.width, 3), (110, 100, 120), np.uint8)


@pytest.fixture
def touching(tool, model):
    return sample_contact_poses(tool, 4, np.random.default_rng(5), model, ContactSampling(free_fraction=0.0))


def test_images_and_truth_are_those_of_the_sensor(tool, model, grey, touching):
    digit = SimulatedDigit(tool, model, grey, seed=1)
    true = PenetrationRenderer(tool, model.for_maps).render(touching)
    for pose, expected in zip(touching, true, strict=True):
        frame = digit.look(pose)
        assert (frame.image.shape, frame.image.dtype) == ((320, 240, 3), np.uint8)
        assert frame.truth.in_contact
        assert frame.deepest == pytest.approx(expected.max(), abs=1e-4)
        assert np.abs(frame.truth.penetration - expected).mean() < 1e-5


def test_untouched_gel_is_the_background_but_for_noise(tool, model, grey):
    frame = SimulatedDigit(tool, model, grey, seed=2).look(AWAY)
    assert not frame.truth.in_contact
    assert frame.deepest == 0
    assert np.abs(frame.image.mean(axis=(0, 1)) - (110, 100, 120)).max() < 1.5
    assert 0 < np.abs(frame.image.astype(int) - grey).mean() < 4


def test_a_seed_is_a_sensor_whose_light_does_not_change(tool, model, grey, touching):
    digit = SimulatedDigit(tool, model, grey, seed=3)
    first, second = (digit.look(touching[0]).image.astype(int) for _ in range(2))
    shown = np.abs(first - grey).max()
    assert 0 < np.abs(first - second).mean() < 5
    assert np.abs(first.mean(axis=(0, 1)) - second.mean(axis=(0, 1))).max() < 0.2 < shown
    images = [SimulatedDigit(tool, model, grey, seed).look(touching[0]).image for seed in (4, 4, 5)]
    np.testing.assert_array_equal(images[0], images[1])
    assert np.abs(images[0].astype(int) - images[2]).mean() > 1


def test_the_depth_network_measures_what_is_there(tool, model, grey, touching):
    network, errors, truths = load_tdn("fast", model), [], []
    for seed in range(4):
        digit = SimulatedDigit(tool, model, grey, seed)
        for frame in map(digit.look, touching):
            measured = ContactDetector(model.for_maps).update(network.predict(frame.image, grey)).penetration
            errors.append(measured - frame.truth.penetration)
            truths.append(frame.truth.penetration)
    assert np.sqrt(np.mean(np.square(errors))) < 0.3 * np.sqrt(np.mean(np.square(truths)))

    deep = touching[0].copy()  # inside of the object everything is still finite
    for _ in range(6):
        deep[:3, 3] -= 5e-3 * deep[:3, 2]
        frame = digit.look(deep)
        assert np.isfinite(frame.truth.penetration).all()
        assert np.isfinite(frame.deepest)


def test_no_contact_images_differ_between_sensors():
    sensor, rng = SensorModel.load("digit_tacto"), np.random.default_rng(0)
    one, other = (no_contact_image(sensor, rng).astype(int) for _ in range(2))
    assert np.abs(one - other).mean() > 3
    assert one[160, 30, 0] > one[160, 30, 1]  # red from the left
    assert one[160, 210, 1] > one[160, 210, 0]  # green from the right
