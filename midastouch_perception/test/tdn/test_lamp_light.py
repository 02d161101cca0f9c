import cv2
import numpy as np
import pytest

from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.lamp_light import LampLight

DOWN, ACROSS = np.mgrid[-1:1:320j, -1:1:240j]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def background(rng):
    """A gel whose light has a fine pattern."""
    pattern = 1 + 0.1 * np.sin(12 * DOWN + 3 * ACROSS) * np.sin(9 * ACROSS)
    return lit(np.multiply.outer(pattern, (120.0, 90.0, 60.0)), 1.0, rng)


def lit(gel, light, rng):
    return np.clip(np.rint(gel * light + rng.normal(0, 1.5, gel.shape)), 0, 255).astype(np.uint8)


def of_free_gel(background, rng, frames=10):
    lamps = LampLight(background)
    for _ in range(frames):
        assert lamps.unexplained(lit(background, 1.0, rng)).usual
        lamps.learn()
    return lamps


def test_lamps_that_jump_are_usual_again_and_again(background, rng):
    lamps = of_free_gel(background, rng)
    for _ in range(20):
        slope_x, slope_y = rng.uniform(-0.3, 0.3, (2, 3))
        light = rng.uniform(0.7, 1.5, 3) * (1 + slope_x * ACROSS[..., None] + slope_y * DOWN[..., None])
        left = lamps.unexplained(lit(background, light, rng))
        assert left.usual
        assert left.level < 0.5
        lamps.learn()


def test_lamps_that_warm_in_a_broad_lobe_are_usual(background, rng):
    lamps, lobe = of_free_gel(background, rng), np.exp(-((ACROSS - 0.4) ** 2) - (DOWN + 0.3) ** 2)[..., None]
    for amount in np.linspace(0, 0.3, 90):
        assert lamps.unexplained(lit(background, 1 + amount * lobe, rng)).usual
        lamps.learn()
    assert not of_free_gel(background, rng).unexplained(lit(background, 1 + amount * lobe, rng)).usual, "at once"


def test_a_pattern_that_turns_everywhere_is_unusual_and_dirt_is_not(background, rng):
    lamps = of_free_gel(background, rng)
    turned = 1 + 0.02 * np.sin(7 * DOWN)[..., None] * np.sin(5 * ACROSS)[..., None]
    assert not lamps.unexplained(lit(background, turned, rng)).usual
    dirty = background.copy()
    dirty[40:100, 40:100] //= 2
    left = lamps.unexplained(lit(dirty, 1.0, rng))
    assert left.usual
    assert left.level > 1.5
    assert left.fraction > 0.5


def test_a_weave_is_unusual_although_blocks_have_the_means_of_free_gel(background, rng):
    lamps, here = of_free_gel(background, rng), np.hypot(ACROSS, DOWN) < 0.5
    rows, columns = np.mgrid[:320, :240]
    weave = 0.15 * here * np.sin(np.pi / 4 * rows) * np.sin(np.pi / 4 * columns)
    woven = lit(background, 1 + weave[..., None], rng)
    left = lamps.unexplained(woven)
    assert left.level < 0.5
    assert left.detailed
    assert not left.usual
    lamps.learn()  # these are marks
    assert lamps.unexplained(woven).usual


def test_another_gel_and_a_white_image_are_unusual_from_the_start(rng):
    mini = SensorCalibration.default(SensorModel.load("gelsight_mini")).background
    image = np.repeat(np.repeat(mini, 320 // mini.shape[0], axis=0), 240 // mini.shape[1], axis=1).astype(np.uint8)
    for lamps in (LampLight(image), of_free_gel(image, rng)):
        assert not lamps.unexplained(image[::-1]).usual
        assert not lamps.unexplained(np.full_like(image, 255)).usual


def test_compression_hides_a_faint_change(background, rng):
    """A JPEG is quiet at rest, and not after any change, such as one of the lamps."""

    def compressed(light):
        image = lit(background, light, rng)
        return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1], cv2.IMREAD_COLOR)

    lamps = LampLight(compressed(1.0))
    for _ in range(10):
        assert lamps.unexplained(compressed(1.0)).usual
        lamps.learn()
    assert all(lamps.unexplained(compressed(1 + rng.normal(0, 0.01, 3))).usual for _ in range(10))
    turned = 1 + 0.08 * np.sin(7 * DOWN)[..., None] * np.sin(5 * ACROSS)[..., None]
    assert not lamps.unexplained(compressed(turned)).usual
