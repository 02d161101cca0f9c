"""Motion with noise: the numbers drawn are normal, independent and repeatable."""

import numpy as np
import pytest
from scipy import linalg, stats
from scipy.spatial.transform import Rotation

import midastouch_kernels as kernels

COUNT = 200_000
STILL = np.array([0, 0, 0, 0, 0, 0, 1], np.float32)
SMALL = np.full(6, 1e-3, np.float32)


def moved(noise: kernels.NormalStream | None, step: np.ndarray = STILL, count: int = COUNT) -> tuple:
    positions, quaternions = np.zeros((count, 3), np.float32), np.tile(STILL[3:], (count, 1))
    kernels.compose(0, count, positions, quaternions, step, SMALL, noise)
    return positions, quaternions


def drawn(seed: int) -> np.ndarray:
    """(COUNT, 6) numbers, as seen in how particles at rest are moved."""
    positions, quaternions = moved(kernels.NormalStream(seed))
    return np.hstack([positions, quaternions[:, :3]]) / SMALL[0]


@pytest.fixture(scope="module")
def numbers() -> np.ndarray:
    return drawn(1)


def test_numbers_are_standard_normal(numbers):
    error = 1 / np.sqrt(COUNT)
    assert np.abs(numbers.mean(axis=0)).max() < 5 * error
    assert np.abs(numbers.std(axis=0) - 1).max() < 5 * error
    assert np.abs(stats.skew(numbers)).max() < 5 * np.sqrt(6) * error
    assert np.abs(stats.kurtosis(numbers)).max() < 5 * np.sqrt(24) * error
    for column in numbers.T:
        assert stats.kstest(column, "norm").pvalue > 1e-4


def test_numbers_are_independent(numbers):
    error = 5 / np.sqrt(COUNT)
    for values in (numbers, np.abs(numbers)):
        between = np.corrcoef(values.T) - np.eye(6)
        assert np.abs(between).max() < error
        for lag in (1, 2, 7, 8, 16):  # eight streams lie side by side
            for column in values.T:
                assert abs(np.corrcoef(column[lag:], column[:-lag])[0, 1]) < error


def test_equal_seeds_give_equal_numbers_and_others_do_not(numbers):
    np.testing.assert_array_equal(drawn(1), numbers)
    assert abs(np.corrcoef(drawn(2)[:, 0], numbers[:, 0])[0, 1]) < 5 / np.sqrt(COUNT)


def test_without_noise_all_move_by_the_step():
    step = np.array([1e-3, 2e-3, 3e-3, 0, 0, np.sin(0.1), np.cos(0.1)], np.float32)
    positions, quaternions = moved(None, step, 13)
    np.testing.assert_allclose(positions, np.tile(step[:3], (13, 1)), rtol=1e-6)
    np.testing.assert_allclose(quaternions, np.tile(step[3:], (13, 1)), rtol=1e-6)


def spread(centres, index, factor, normal):
    count = len(index)
    positions, quaternions = np.empty((count, 3), np.float32), np.empty((count, 4), np.float32)
    kernels.spread(0, count, centres, index, factor, normal, positions, quaternions)
    return positions, quaternions


def test_poses_are_spread_by_the_exponential_in_the_frame_of_their_centre():
    rng = np.random.default_rng(5)
    twists, factor, normal = (
        rng.standard_normal((3, 6)),
        0.3 * rng.standard_normal((6, 6)),
        rng.standard_normal((50, 6)),
    )
    centres = np.stack([linalg.expm(matrix(twist)) for twist in twists])
    index = rng.integers(3, size=50)
    positions, quaternions = spread(centres, index, factor, normal)
    for i in range(50):
        pose = centres[index[i]] @ linalg.expm(matrix(factor @ normal[i]))
        np.testing.assert_allclose(positions[i], pose[:3, 3], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(
            Rotation.from_quat(quaternions[i].astype(float)).as_matrix(), pose[:3, :3], atol=1e-6
        )


def matrix(twist):
    """(4, 4) of a tangent vector [rho, omega], whose exponential is a transform."""
    x, y, z = twist[3:]
    out = np.zeros((4, 4))
    out[:3] = np.column_stack([[[0, -z, y], [z, 0, -x], [-y, x, 0]], twist[:3]])
    return out


def test_a_centre_that_is_not_there_is_refused():
    for missing in (-1, 1):
        with pytest.raises(ValueError, match="not there"):
            spread(np.eye(4)[None], np.array([missing]), np.eye(6), np.zeros((1, 6)))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 0.4, 0.41, 1.5, 3.1])
def test_a_gaussian_mapped_to_itself_moves_nobody(angle):
    axis = np.array([0.6, 0.0, 0.8])
    quaternions = np.tile([*(np.sin(angle / 2) * axis), np.cos(angle / 2)], (3, 1)).astype(np.float32)
    positions = np.array([[0.01, 0.02, 0.03]] * 3, np.float32)
    before = positions.copy(), quaternions.copy()
    here = np.zeros((1, 3)), np.eye(3)[None], np.array([[0.0, 0, 0, 1]])
    there = np.ones((1, 3)), *here[1:]
    members, map_of = np.array([0, 1, -1], np.int32), np.array([0, -1], np.int32)
    kernels.map_modes(0, 3, members, map_of, *here, *there, np.eye(6)[None], positions, quaternions)
    np.testing.assert_allclose(positions[0], before[0][0] + 1, rtol=1e-6)
    np.testing.assert_array_equal(positions[1:], before[0][1:])
    np.testing.assert_allclose(quaternions, before[1], atol=2e-7)


def test_a_mode_or_map_that_is_not_there_is_refused():
    gaussian = np.zeros((1, 3)), np.eye(3)[None], np.array([[0.0, 0, 0, 1]])
    particles = np.zeros((1, 3), np.float32), np.array([[0, 0, 0, 1]], np.float32)
    for member, map_of in ((1, 0), (0, 1)):
        tables = np.array([member], np.int32), np.array([map_of], np.int32)
        with pytest.raises(ValueError, match="not there"):
            kernels.map_modes(0, 1, *tables, *gaussian, *gaussian, np.eye(6)[None], *particles)
