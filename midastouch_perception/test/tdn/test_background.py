import cv2
import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.optics import TactoOptics
from midastouch_perception.tdn import estimate_background, load_tdn
from midastouch_perception.tdn.background import doubtful_share, shows_contact


def test_contacts_that_move_on_vanish():
    rng = np.random.default_rng(0)
    background = rng.integers(50, 200, (320, 240, 3)).astype(np.uint8)
    frames = []
    for i in range(15):
        frame = background.copy()
        frame[20 * i : 20 * i + 60] = 255
        frames.append(frame)
    np.testing.assert_array_equal(estimate_background(frames), background)


def test_nothing_to_estimate_from():
    with pytest.raises(InputError, match="no frames"):
        estimate_background([])


def test_frames_of_different_sensors():
    with pytest.raises(InputError, match="different size"):
        estimate_background([np.zeros((320, 240, 3), np.uint8), np.zeros((240, 320, 3), np.uint8)])


def slide(step: int) -> list[np.ndarray]:
    """A contact 60 rows high that moves on by `step` rows a frame and looks different in each."""
    frames = []
    for i in range(15):
        frame = np.full((320, 240, 3), 100, np.uint8)
        frame[step * i : step * i + 60] += np.uint8(10 + 6 * i)
        frames.append(frame)
    return frames


def test_a_contact_that_hardly_moves_leaves_a_doubtful_background():
    for step, doubtful in ((20, False), (2, True)):
        frames = slide(step)
        assert (doubtful_share(frames, estimate_background(frames)) > 0.1) == doubtful
    agreed = [np.full((320, 240, 3), level, np.uint8) for level in (99, 100, 101)]
    assert doubtful_share(agreed, estimate_background(agreed)) == 0


@pytest.fixture(scope="module")
def tdn():
    return load_tdn("fast")


@pytest.fixture(scope="module")
def presses(tool, sensor):
    """Images of firm touches and two images of the untouched gel."""
    rng = np.random.default_rng(0)
    sampling = ContactSampling(press=(0.8e-3, 1.5e-3), free_share=0.0)
    maps = PenetrationRenderer(tool, sensor).render_with_normals(sample_contact_poses(tool, 8, rng, sensor, sampling))
    plain, optics = np.full((320, 240, 3), (120, 110, 130), np.uint8), TactoOptics(sensor)
    images = [optics.image(p, plain, rng, n) for p, n in zip(*maps, strict=True)]
    nothing = np.zeros((320, 240), np.float32)
    return images, optics.image(nothing, plain, rng), optics.image(nothing, plain, rng)


def test_a_touch_is_no_background(tdn, presses):
    images, free, other = presses
    assert np.mean([shows_contact(tdn, image, free) for image in images]) >= 0.8
    assert not shows_contact(tdn, other, free)


def test_a_free_sensor_replaces_a_background_taken_in_contact(tdn, presses):
    images, free, _ = presses
    assert not any(shows_contact(tdn, free, image) for image in images)


def test_another_sensor_s_image_is_not_taken_for_a_touch(tdn, presses):
    images, free, _ = presses
    assert not shows_contact(tdn, np.roll(free, 1, axis=2), free)
    tinted = images[0] + np.linspace(-60, 60, 240)[None, :, None] * (1, -1, 0)
    assert not shows_contact(tdn, np.clip(tinted, 0, 255).astype(np.uint8), free)


@pytest.mark.parametrize("gain", [0.85, 1.15])
def test_a_touch_is_one_at_another_brightness_too(tdn, presses, gain):
    images, free, _ = presses
    changed = [np.clip(image * gain, 0, 255).astype(np.uint8) for image in images]
    assert np.mean([shows_contact(tdn, image, free) for image in changed]) >= 0.8


def test_real_presses_are_no_backgrounds(shared):
    """Which of two real images shows the contact; the network has never seen that sensor."""
    folder = shared / "data/digit_real/ball_presses"
    tdn = load_tdn("fast", SensorModel.load("digit_real"))
    free, *touched = (
        cv2.cvtColor(cv2.imread(str(folder / name)), cv2.COLOR_BGR2RGB)
        for name in ("background.png", *(f"{i:04d}.png" for i in range(1, 42, 5)))
    )
    assert np.mean([shows_contact(tdn, image, free) for image in touched]) >= 0.7
    assert np.mean([shows_contact(tdn, free, image) for image in touched]) <= 0.2
