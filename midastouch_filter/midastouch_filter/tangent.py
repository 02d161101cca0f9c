"""SE(3) exponential and logarithm for Numba kernels; `se3.py` has them for arrays. Vectors are [rho, omega]."""

from __future__ import annotations

import numba
import numpy as np

from . import quaternion

_SMALL = 1e-4  # rad: series instead of quotients of small numbers


@numba.njit(cache=True)
def exp(xi):
    """Transform (4, 4) of a tangent vector (6,) float64."""
    w = _skew(xi[3:])
    w2 = w @ w
    angle = np.sqrt((xi[3:] * xi[3:]).sum())
    if angle < _SMALL:
        a, b, c = 1 - angle**2 / 6, 0.5 - angle**2 / 24, 1 / 6 - angle**2 / 120
    else:
        a, b, c = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    out = np.eye(4)
    out[:3, :3] += a * w + b * w2
    out[:3, 3] = (np.eye(3) + b * w + c * w2) @ np.ascontiguousarray(xi[:3])
    return out


@numba.njit(cache=True)
def log(transform):
    """Tangent vector (6,) of a transform (4, 4) float64; angle in [0, pi]."""
    q = quaternion.from_matrix(transform[:3, :3])
    if q[3] < 0:
        q = -q
    sine = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    angle = 2 * np.arctan2(sine, q[3])
    out = np.empty(6)
    out[3:] = q[:3] * (angle / sine if sine > 0 else 2.0)
    half = angle / 2
    d = 1 / 12 + angle**2 / 720 if angle < _SMALL else (1 - half * np.cos(half) / np.sin(half)) / angle**2
    w = _skew(out[3:])
    out[:3] = (np.eye(3) - 0.5 * w + d * (w @ w)) @ np.ascontiguousarray(transform[:3, 3])
    return out


@numba.njit(cache=True)
def inverse(transform):
    """Inverse of a rigid transform (4, 4)."""
    out = np.eye(4)
    rotation = np.ascontiguousarray(transform[:3, :3].T)
    out[:3, :3] = rotation
    out[:3, 3] = -(rotation @ np.ascontiguousarray(transform[:3, 3]))
    return out


@numba.njit(cache=True)
def _skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
