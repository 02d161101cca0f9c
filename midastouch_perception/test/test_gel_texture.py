import cv2
import numpy as np
import pytest

from midastouch_perception.gel_texture import GelCheck, gel_texture, likeness, worn_gel
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.optics import TactoOptics
from midastouch_tools.datasets.ball_presses import load_ball_presses

NOTHING = np.zeros((160, 120), np.float32)


def gel(seed, contrast=1.5):
    """A gel (320, 240, 3) float: light that falls off to the sides, and grains."""
    rows, columns = np.mgrid[:320, :240]
    light = np.stack([120 - columns / 6, 100 + rows / 10, 90 + columns / 8], axis=-1)
    grains = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (320, 240)), (0, 0), 1.5)
    return light + contrast * (grains / grains.std())[..., None]


def image(gel, rng, brightness=1.0):
    """One image of it, with a camera's noise."""
    return np.clip(np.rint(brightness * gel + rng.normal(0, 2, gel.shape)), 0, 255).astype(np.uint8)


def watched(background, images, penetration=NOTHING):
    """A check after these images."""
    check = GelCheck(SensorModel.load("digit_real"), every=1, window=len(images))
    for each in images:
        check.observe(each, background, penetration)
    return check


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_a_gel_is_known_at_any_brightness_and_others_are_not(rng):
    known = gel_texture(image(gel(1), rng))
    same = [likeness(known, gel_texture(image(gel(1), rng, each))) for each in (0.7, 1.0, 1.2)]
    others = [likeness(known, gel_texture(image(gel(seed), rng))) for seed in range(2, 12)]
    assert all(each.same and each.shift == (0, 0) for each in same)
    assert not any(each.same for each in others)


def test_a_smooth_image_has_no_texture(rng):
    smooth = np.rint(gel(1, contrast=0)).astype(np.uint8)
    assert not gel_texture(smooth).any()
    assert likeness(gel_texture(smooth), gel_texture(smooth)).sigmas == 0
    assert not watched(image(gel(1), rng), [smooth] * 8).problem


def test_a_smooth_simulated_gel_is_left_in_peace(rng):
    sensor = SensorModel.load("digit_tacto")
    background, optics = no_contact_image(sensor, rng), TactoOptics(sensor)
    untouched = np.zeros((320, 240), np.float32), np.tile(np.float32([0, 0, 1]), (320, 240, 1))
    check = watched(background, [optics.image(untouched[0], background, rng, untouched[1]) for _ in range(16)])
    assert check.sigmas is None
    assert not check.problem


def test_another_gel_and_one_that_moved_are_told_apart(rng):
    images = [image(gel(1), rng) for _ in range(8)]
    assert not watched(image(gel(1), rng, 0.9), images).problem
    assert "of another gel" in watched(image(gel(2), rng), images).problem
    moved = np.roll(gel(1), (3, -4), axis=(0, 1))
    check = watched(image(gel(1), rng), [image(moved, rng) for _ in range(8)])
    assert "the gel has moved by 0.27 mm" in check.problem  # 5 of 18.5 px/mm


def test_a_spot_is_said_with_where_it_is(rng):
    spoiled = gel(1, contrast=3)
    spoiled[90:150, 60:120] = gel(7, contrast=3)[90:150, 60:120]
    check = watched(image(gel(1, contrast=3), rng), [image(spoiled, rng) for _ in range(8)])
    assert "dirty or worn" in check.problem
    assert "5 mm from its left and 6 mm from its top" in check.problem
    known, seen = gel_texture(image(gel(1, contrast=3), rng)), gel_texture(image(spoiled, rng))
    assert not worn_gel(known, gel_texture(image(gel(1, contrast=3), rng)), (0, 0)).any()
    assert worn_gel(known, seen, (0, 0))[112, 82]


def test_what_is_touched_does_not_count(rng):
    touching, everywhere = gel(1), np.ones((160, 120), np.float32)
    touching[:, :120] = gel(9)[:, :120]
    left = everywhere.copy()
    left[:, 60:] = 0
    check = watched(image(gel(1), rng), [image(touching, rng) for _ in range(8)], left)
    assert check.sigmas > 6
    assert not check.problem
    assert not watched(image(gel(1), rng), [image(gel(9), rng) for _ in range(8)], everywhere).problem


def test_real_gels_are_told_apart_and_known_again(shared):
    folders = ("digit_real/sphere_presses_d20641", "digit_real/ball_presses", "gelsight_mini/presses_6310")
    presses = [load_ball_presses(shared / "data" / folder) for folder in folders]
    mini = load_ball_presses(shared / "data/gelsight_mini/presses_9500")
    for each in presses:
        for other in presses:
            check = watched(other.background, list(each.images.values())[:16])
            assert ("of another gel" in check.problem) == (other is not each)
    assert not watched(presses[2].background, list(mini.images.values())[:16]).problem  # another day's images
