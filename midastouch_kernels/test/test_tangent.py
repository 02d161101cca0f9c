"""Covariances of poses against the same by finite differences."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm, logm

import midastouch_kernels as kernels

RNG = np.random.default_rng(0)


def transform(vector: np.ndarray) -> np.ndarray:
    """(4, 4), the exponential of a tangent vector [rho, omega]."""
    x, y, z = vector[3:]
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]], vector[:3]
    return expm(generator)


def offset(pose: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(6,) that moves one to the other."""
    found = np.real(logm(np.linalg.inv(pose) @ other))
    return np.array([*found[:3, 3], found[2, 1], found[0, 2], found[1, 0]])


def test_a_covariance_follows_its_frame():
    pose, motion = transform(RNG.standard_normal(6)), transform(RNG.standard_normal(6))
    vector, step = RNG.standard_normal(6), 1e-6
    (there,) = kernels.transform_covariances(np.outer(vector, vector)[None], motion)
    seen = offset(pose @ motion, pose @ transform(step * vector) @ motion) / step
    np.testing.assert_allclose(there, np.outer(seen, seen), rtol=1e-4, atol=1e-4)


def test_several_covariances_at_once():
    motion, roots = transform(RNG.standard_normal(6)), RNG.standard_normal((3, 6, 6))
    some = roots @ roots.transpose(0, 2, 1)
    one_by_one = [kernels.transform_covariances(each[None], motion)[0] for each in some]
    np.testing.assert_array_equal(kernels.transform_covariances(some, motion), one_by_one)
