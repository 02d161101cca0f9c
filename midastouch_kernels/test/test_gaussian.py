"""Gaussians over poses against the same in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, logm

import midastouch_kernels as kernels

RNG = np.random.default_rng(0)


def covariance(size: float) -> np.ndarray:
    """(6, 6), of about `size` m and rad."""
    root = size * RNG.standard_normal((6, 6))
    return root @ root.T + size**2 * np.eye(6)


def generator(vector: np.ndarray) -> np.ndarray:
    """(4, 4) of a tangent vector [rho, omega]."""
    x, y, z = vector[3:]
    out = np.zeros((4, 4))
    out[:3, :3], out[:3, 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]], vector[:3]
    return out


def moved(pose: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return pose @ expm(generator(vector))


def offset(pose: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(6,) that moves one to the other."""
    found = np.real(logm(np.linalg.inv(pose) @ other))
    return np.array([*found[:3, 3], found[2, 1], found[0, 2], found[1, 0]])


@pytest.fixture
def pose():
    return moved(np.eye(4), RNG.standard_normal(6))


@pytest.fixture
def near(pose):
    return moved(pose, 0.01 * RNG.standard_normal(6))


def test_a_covariance_follows_its_frame(pose):
    motion, vector, step = moved(np.eye(4), RNG.standard_normal(6)), RNG.standard_normal(6), 1e-6
    (there,) = kernels.transform_covariances(np.outer(vector, vector)[None], motion)
    seen = offset(pose @ motion, moved(pose, step * vector) @ motion) / step
    np.testing.assert_allclose(there, np.outer(seen, seen), rtol=1e-4, atol=1e-4)


def test_several_covariances_at_once(pose):
    some = np.stack([covariance(size) for size in (0.1, 1.0, 2.0)])
    one_by_one = [kernels.transform_covariances(each[None], pose)[0] for each in some]
    np.testing.assert_array_equal(kernels.transform_covariances(some, pose), one_by_one)


def test_condition_is_that_of_the_joint_gaussian(pose, near):
    prior, jitter = covariance(0.01), covariance(0.003)
    posterior = np.linalg.inv(np.linalg.inv(prior + jitter) + np.linalg.inv(covariance(0.005)))
    mean, left = kernels.condition(pose, prior, jitter, near, posterior)
    # the sum's posterior is that of a measurement of the sum
    measured = np.linalg.inv(np.linalg.inv(posterior) - np.linalg.inv(prior + jitter))
    np.testing.assert_allclose(left, np.linalg.inv(np.linalg.inv(prior) + np.linalg.inv(jitter + measured)), rtol=1e-6)
    expected = prior @ np.linalg.solve(prior + jitter, offset(pose, near))
    np.testing.assert_allclose(offset(pose, mean), expected, atol=1e-9)


@pytest.mark.parametrize("factor", [0.0, 0.3, 1.0])
def test_weaken_takes_part_of_the_information(pose, near, factor):
    prior = covariance(0.01)
    posterior = np.linalg.inv(np.linalg.inv(prior) + np.linalg.inv(covariance(0.005)))
    mean, left = kernels.weaken(pose, prior, near, posterior, factor)
    before, after = np.linalg.inv(prior), np.linalg.inv(posterior)
    np.testing.assert_allclose(np.linalg.inv(left), before + factor * (after - before), rtol=1e-6, atol=1e-3)
    expected = left @ (factor * after @ offset(pose, near))
    np.testing.assert_allclose(offset(pose, mean), expected, atol=1e-9)
    if factor == 1.0:
        np.testing.assert_allclose(mean, near, atol=1e-9)


def test_what_is_no_covariance_is_refused(pose):
    with pytest.raises(ValueError, match="not positive definite"):
        kernels.condition(pose, -np.eye(6), np.zeros((6, 6)), pose, np.eye(6))
