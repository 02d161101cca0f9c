"""Motion with noise: the numbers drawn are normal, independent and repeatable."""

import numpy as np
import pytest
from scipy import stats

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
