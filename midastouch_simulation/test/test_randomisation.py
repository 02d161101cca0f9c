import dataclasses

import numpy as np
import pytest

from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.optics import ColourTable
from midastouch_simulation.randomisation import RandomisationRange, RandomSensor


@pytest.fixture(scope="module")
def half(sensor):
    return sensor.scaled(0.5)


@pytest.fixture(scope="module")
def touches(tool, half):
    return PenetrationRenderer(tool, half).render_with_normals(
        sample_contact_poses(tool, 6, np.random.default_rng(0), half)
    )


@pytest.fixture(scope="module")
def backgrounds():
    return np.random.default_rng(1).integers(60, 180, (3, 160, 120, 3)).astype(np.uint8)


@pytest.mark.parametrize("seed", range(8))
def test_images_are_finite_grey_levels(touches, half, backgrounds, seed):
    rng = np.random.default_rng(seed)
    images, reference = RandomSensor(half, backgrounds, rng).images(*touches, rng)
    assert images.shape == (6, 160, 120, 3)
    assert reference.shape == (160, 120, 3)
    for array in (images, reference):
        assert np.isfinite(array).all()
        assert array.min() >= 0
        assert array.max() <= 255


def test_same_seed_same_image(touches, half, backgrounds):
    images = []
    for _ in range(2):
        rng = np.random.default_rng(4)
        images.append(RandomSensor(half, backgrounds, rng).images(*touches, rng)[0])
    np.testing.assert_array_equal(*images)


def test_wide_sensors_differ_more_from_each_other(touches, half, backgrounds):
    """The spread of contrast over sensors is what `wide_fraction` buys."""

    def contrast(fraction):
        out = []
        for seed in range(12):
            rng = np.random.default_rng(seed)
            imaginary = RandomSensor(half, backgrounds, rng, RandomisationRange(wide_fraction=fraction))
            images, reference = imaginary.images(*touches, rng)
            out.append(np.abs(images - reference)[touches[0] > 0].mean())
        return np.std(np.log(out))

    assert contrast(1.0) > 1.5 * contrast(0.0)


def test_untouched_gel_looks_like_the_reference(touches, half, backgrounds):
    penetration, normals = (np.zeros_like(a) for a in touches)
    rng = np.random.default_rng(2)
    images, reference = RandomSensor(half, backgrounds, rng, RandomisationRange(0.0)).images(penetration, normals, rng)
    assert np.abs(images.mean(axis=0) - reference).mean() < 6


def sensors_with_table(strength: float) -> RandomisationRange:
    """Every sensor shines by a table whose channels answer to the slope's direction, 120 deg apart."""
    angle = np.linspace(-np.pi, np.pi, 24)
    coefficients = np.zeros((8, 24, 6, 3))
    for channel in range(3):
        coefficients[:, :, 5, channel] = strength * np.arange(8)[:, None] * np.cos(angle + 2.1 * channel)
    return RandomisationRange(wide_fraction=1.0, table_fraction=1.0, colour_table=ColourTable(coefficients))


@pytest.mark.parametrize("seed", range(4))
def test_sensors_with_a_colour_table(touches, half, backgrounds, seed):
    """They differ from those with an empty table where they are touched, and hardly elsewhere."""
    images = []
    for strength in (12.0, 0.0):
        rng = np.random.default_rng(seed)
        images.append(RandomSensor(half, backgrounds, rng, sensors_with_table(strength)).images(*touches, rng)[0])
    assert all(np.isfinite(one).all() and one.min() >= 0 and one.max() <= 255 for one in images)
    change = np.abs(images[0] - images[1]).mean(axis=-1)
    touched = touches[0] > 0
    assert change[touched].mean() > 1
    assert change[touched].mean() > 2.5 * change[~touched].mean()


def test_no_table_for_sensors_near_tacto(touches, half, backgrounds):
    images = []
    for table in (sensors_with_table(12.0).colour_table, None):
        rng = np.random.default_rng(5)
        ranges = RandomisationRange(wide_fraction=0.0, table_fraction=1.0, colour_table=table)
        images.append(RandomSensor(half, backgrounds, rng, ranges).images(*touches, rng)[0])
    np.testing.assert_array_equal(*images)


@pytest.mark.parametrize("seed", range(4))
def test_real_gel_changes_by_a_share_of_its_background(touches, half, backgrounds, seed):
    """Twice as bright lamps: twice the change, which sensors whose light is additive do not show."""
    relative = dataclasses.replace(half, light="relative")
    dim = (backgrounds // 2).astype(np.uint8)
    means = []
    for shown in (dim, 2 * dim):
        rng = np.random.default_rng(seed)
        images, reference = RandomSensor(relative, shown, rng).images(*touches, rng)
        assert np.isfinite(images).all()
        assert (images.min() >= 0) & (images.max() <= 255)
        means.append(np.abs(images - reference).mean())
    assert 1.5 < means[1] / means[0] < 2.5
