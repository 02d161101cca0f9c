"""Results against what NumPy says, however slowly."""

from __future__ import annotations

import numpy as np
import pytest

import midastouch_kernels as kernels

from .sheet import GEL_DISTANCE, HEIGHT, WIDTH, poses_above


def test_farthest_points():
    features = np.random.default_rng(2).standard_normal((500, 6))
    features[100:150] = features[:50]  # doubled ones too
    expected, nearest = [0], np.full(500, np.inf)
    for _ in range(479):
        nearest = np.minimum(nearest, ((features - features[expected[-1]]) ** 2).sum(axis=1))
        expected.append(int(nearest.argmax()))
    found = kernels.farthest_points(features, 480)
    np.testing.assert_array_equal(found[:450], expected[:450])
    assert set(found[450:]) == {0}  # all left are doubles: the first of the equally far ones
    assert len(kernels.farthest_points(features, 600)) == 500


def test_neighbours():
    coordinates = np.unique(np.random.default_rng(3).integers(2, 12, (300, 3)), axis=0)
    width, plane = 14, 14 * 14
    keys = coordinates @ [1, width, plane]
    coordinates, keys = coordinates[keys.argsort()], np.sort(keys)
    rows = kernels.neighbours(keys, width, plane, 1)
    assert rows.shape == (27, len(keys))
    of = {tuple(c): i for i, c in enumerate(coordinates)}
    for k in range(27):
        offset = np.array([k % 3 - 1, k // 3 % 3 - 1, k // 9 - 1])
        np.testing.assert_array_equal(rows[k], [of.get(tuple(c + offset), -1) for c in coordinates])


def test_render_of_a_surface_level_with_the_gel(scene):
    poses = poses_above(3)
    poses[:, 2, 3] = -0.5e-3
    penetration = np.zeros((3, HEIGHT, WIDTH), np.float32)
    faces = np.full(penetration.shape, -1, np.int32)
    kernels.render(scene, poses, penetration, faces)
    # bumps of 1 mm and dips of 1 mm, pressed by half of one
    assert penetration.max() == pytest.approx(1.5e-3, abs=1e-4)
    assert penetration.min() == 0
    np.testing.assert_array_equal(faces >= 0, penetration > 0)


def test_render_of_a_pose_that_is_not_a_number_draws_nothing(scene):
    penetration = np.zeros((1, HEIGHT, WIDTH), np.float32)
    kernels.render(scene, np.full((1, 4, 4), np.nan), penetration, np.empty((1, 0, 0), np.int32))
    assert not penetration.any()


def test_means_over_blocks():
    rng = np.random.default_rng(4)
    image = rng.integers(0, 256, (32, 24, 3), np.uint8)
    expected = image.reshape(16, 2, 12, 2, 3).mean(axis=(1, 3))
    np.testing.assert_array_equal(kernels.halve_image(image), expected.astype(np.float32))
    heights = rng.random((32, 24), np.float32)
    expected = heights.reshape(8, 4, 8, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(kernels.block_means(heights, 4, 3), expected, rtol=1e-6)


def test_shade_is_brighter_towards_the_light():
    depth = np.full((8, 8), GEL_DISTANCE, np.float32)
    tangent = np.zeros((8, 8), np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (8, 8, 1))
    normals[4:] = np.float32([0.6, 0, 0.8])
    light, colour = np.float32([[0.02, 0, -0.005]]), np.float32([[1e-3, 0, 2e-3]])
    image = kernels.shade(depth, normals, tangent, tangent, light, colour, 0.0, 0.08, 0.1, 0.8)
    assert image.shape == (8, 8, 3)
    assert (image[4:, :, 0] > 1.2 * image[:4, :, 0]).all()
    np.testing.assert_allclose(image[..., 2], image[..., 0] * 2 ** (1 / 2.2), rtol=1e-5)
    assert image[..., 1].max() < 1e-6


@pytest.mark.parametrize("shape", [(160, 120), (9, 5), (8, 6)])
def test_change_beside_each_colours_gain(shape):
    rng = np.random.default_rng(5)
    image, background = rng.uniform(20, 250, (2, *shape, 3)).astype(np.float32)
    image[..., 1] += np.float32(100)
    image[..., 2] *= np.float32(1e-3)
    sparse = 1 / background[::4, ::4]
    gain = np.median((image[::4, ::4] * sparse).reshape(-1, 3), axis=0)
    assert gain[2] < 0.1 < gain[0]
    gain = np.maximum(gain, np.float32(0.1))
    assert (background > 255 / gain).any(), "it would be white in this light"
    expected = image / gain - np.minimum(background, 255 / gain)
    np.testing.assert_array_equal(kernels.change_beside_gain(image, background, sparse, 4, 0.1), expected)


def test_planes():
    images = np.random.default_rng(6).standard_normal((2, 5, 4, 3)).astype(np.float32)
    np.testing.assert_array_equal(kernels.planes(images, 0.25), np.moveaxis(images / 4, -1, 1))


def heights_of(slopes, region, pixel):
    """The same by dense least squares: a row for every pair of neighbours of which one is in the region."""
    index = np.full(region.shape, -1)
    index[region > 0] = np.arange(np.count_nonzero(region))
    rows, steps = [], []
    for axis, part in ((1, 0), (0, 1)):
        for here in np.ndindex(*(np.array(region.shape) - (axis == np.arange(2)))):
            there = (here[0] + (axis == 0), here[1] + (axis == 1))
            row = np.zeros(np.count_nonzero(region) + 1)
            row[index[there]] += 1
            row[index[here]] -= 1
            rows.append(row[:-1])
            steps.append(pixel * (slopes[here][part] + slopes[there][part]) / 2)
    out = np.zeros(region.shape)
    out[region > 0] = np.linalg.lstsq(np.array(rows), np.array(steps), rcond=None)[0]
    return out


@pytest.mark.parametrize("at_the_edge", [False, True])
def test_heights_are_those_with_the_nearest_slopes(at_the_edge):
    rng = np.random.default_rng(5)
    rows, columns = np.mgrid[:26, :21]
    region = (np.hypot(rows - 12, columns - (3 if at_the_edge else 10)) < 8) & (np.hypot(rows - 10, columns - 8) > 2)
    slopes = rng.normal(0.2, 0.5, (26, 21, 2)).astype(np.float32)
    found = kernels.integrate_slopes(slopes, region.astype(np.uint8), 1e-4)
    expected = heights_of(slopes, region, 1e-4)
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())
    assert not found[~region].any()


def test_heights_without_anything_beside_them_begin_at_nothing():
    rows, columns = np.mgrid[:30, :20] * 1e-4
    slopes = np.broadcast_to(np.float32([0.3, -0.2]), (30, 20, 2)).copy()
    found = kernels.integrate_slopes(slopes, np.ones((30, 20), np.uint8), 1e-4)
    plane = 0.3 * columns - 0.2 * rows
    np.testing.assert_allclose(found, plane - plane.min(), atol=5e-6)


def test_heights_of_slopes_that_are_no_numbers_are_finite():
    slopes, region = np.full((20, 20, 2), np.nan, np.float32), np.zeros((20, 20), np.uint8)
    assert not kernels.integrate_slopes(slopes, region, 1e-4).any()
    region[5:9, 5:9] = 1
    assert not kernels.integrate_slopes(slopes, region, 1e-4).any()
