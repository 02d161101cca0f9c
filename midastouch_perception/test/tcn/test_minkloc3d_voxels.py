import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_common.errors import InputError
from midastouch_perception.tcn.minkloc3d_voxels import Voxels, quantise

coordinates = st.lists(st.tuples(*[st.integers(-5, 5)] * 3), min_size=1, max_size=40).map(np.array)


@given(coordinates, st.sampled_from([1, 2]))
def test_neighbours_are_those_of_a_brute_force_search(points, radius):
    voxels = Voxels(points)
    rows = {tuple(c): i for i, c in enumerate(voxels.coordinates)}
    found = voxels.neighbours(radius)
    span = range(-radius, radius + 1)
    offsets = [(x, y, z) for z in span for y in span for x in span]
    expected = [[rows.get(tuple(c + o), -1) for c in voxels.coordinates] for o in offsets]
    np.testing.assert_array_equal(found, expected)


@given(coordinates)
def test_every_voxel_once_and_x_fastest(points):
    got = Voxels(points).coordinates
    assert sorted(map(tuple, got[:, ::-1])) == sorted({tuple(p) for p in points[:, ::-1]})
    assert list(map(tuple, got[:, ::-1])) == sorted(map(tuple, got[:, ::-1]))


@given(coordinates)
def test_coarser_voxels_hold_the_finer(points):
    """Rounded down, also below zero: -1 belongs to the coarse voxel -1, as its upper part."""
    voxels = Voxels(points)
    coarse, holder, part = voxels.coarser()
    parts = np.stack([part & 1, part >> 1 & 1, part >> 2], axis=1)
    np.testing.assert_array_equal(2 * coarse.coordinates[holder] + parts, voxels.coordinates)
    assert len(coarse.coordinates) == len({tuple(c) for c in voxels.coordinates // 2})


def test_quantise_rounds_down():
    cloud = np.array([[0.0, 0.0299, -0.0001], [0.01, -0.03, 1.0]], np.float32)
    assert sorted(map(tuple, quantise(cloud, 0.01).coordinates)) == [(0, 2, -1), (1, -3, 100)]


def test_a_grid_beyond_64_bits_is_refused():
    with pytest.raises(InputError, match="too fine; use a larger voxel size"):
        quantise(np.array([[0, 0, 0], [1, 1, 1]], np.float32), 1e-9)
