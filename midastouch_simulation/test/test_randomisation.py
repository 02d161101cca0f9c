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


def of_seed(seed, touches, half, backgrounds, *ranges):
    """Images of touches and the reference of the imaginary sensor of a seed; both are grey levels."""
    rng = np.random.default_rng(seed)
    found = RandomSensor(half, backgrounds, rng, *ranges).images(*touches, rng)
    for array in found:
        assert np.isfinite(array).all()
        assert 0 <= array.min() <= array.max() <= 255
    return found


def test_a_seed_is_a_sensor(touches, half, backgrounds):
    first, again, other = (of_seed(seed, touches, half, backgrounds) for seed in (4, 4, 5))
    assert (first[0].shape, first[1].shape) == ((6, 160, 120, 3), (160, 120, 3))
    np.testing.assert_array_equal(first[0], again[0])
    assert (first[0] != other[0]).any()


def test_wide_sensors_differ_more_from_each_other(touches, half, backgrounds):
    """The spread of contrast over sensors is what `wide_fraction` buys."""

    def contrast(fraction):
        out = []
        for seed in range(12):
            images, reference = of_seed(seed, touches, half, backgrounds, RandomisationRange(wide_fraction=fraction))
            out.append(np.abs(images - reference)[touches[0] > 0].mean())
        return np.std(np.log(out))

    assert contrast(1.0) > 1.5 * contrast(0.0)


def test_untouched_gel_looks_like_the_reference(touches, half, backgrounds):
    untouched = [np.zeros_like(a) for a in touches]
    images, reference = of_seed(2, untouched, half, backgrounds, RandomisationRange(0.0))
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
    images = [of_seed(seed, touches, half, backgrounds, sensors_with_table(strength))[0] for strength in (12.0, 0.0)]
    change = np.abs(images[0] - images[1]).mean(axis=-1)
    touched = touches[0] > 0
    assert change[touched].mean() > 1
    assert change[touched].mean() > 2.5 * change[~touched].mean()


def test_no_table_for_sensors_near_tacto(touches, half, backgrounds):
    ranges = [dataclasses.replace(sensors_with_table(12.0), wide_fraction=0.0)]
    ranges.append(dataclasses.replace(ranges[0], colour_table=None))
    np.testing.assert_array_equal(*(of_seed(5, touches, half, backgrounds, each)[0] for each in ranges))


@pytest.mark.parametrize("seed", range(4))
def test_real_gel_changes_by_a_share_of_its_background(touches, half, backgrounds, seed):
    """Twice as bright lamps: twice the change, which sensors whose light is additive do not show."""
    relative = dataclasses.replace(half, light="relative")
    dim = (backgrounds // 2).astype(np.uint8)
    means = []
    for shown in (dim, 2 * dim):
        images, reference = of_seed(seed, touches, relative, shown)
        means.append(np.abs(images - reference).mean())
    assert 1.5 < means[1] / means[0] < 2.5
