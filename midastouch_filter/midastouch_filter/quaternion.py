"""Quaternion arithmetic for Numba kernels. Quaternions are xyzw and unit."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, inline="always")
def multiply(ax, ay, az, aw, bx, by, bz, bw):
    """Hamilton product a * b of float32 scalars."""
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@numba.njit(cache=True, inline="always")
def rotate(qx, qy, qz, qw, x, y, z):
    """Vector (x, y, z) of float32 scalars turned by the quaternion: v + 2 w (u x v) + 2 u x (u x v)."""
    two = np.float32(2.0)
    tx, ty, tz = two * (qy * z - qz * y), two * (qz * x - qx * z), two * (qx * y - qy * x)
    return (
        x + qw * tx + qy * tz - qz * ty,
        y + qw * ty + qz * tx - qx * tz,
        z + qw * tz + qx * ty - qy * tx,
    )


@numba.njit(cache=True, inline="always")
def rotation_vector(x, y, z, w):
    """Rotation vector of a unit quaternion of scalars, the shorter way round: angle in [0, pi]."""
    sine = np.sqrt(x * x + y * y + z * z)
    scale = 2 * np.arctan2(sine, abs(w)) / sine if sine > 0 else 2.0
    scale = -scale if w < 0 else scale
    return scale * x, scale * y, scale * z


@numba.njit(cache=True)
def to_matrix(q):
    """Rotation matrix (3, 3) float64 of a unit quaternion (4,) float64."""
    x, y, z, w = q
    r = np.empty((3, 3))
    r[0, 0], r[0, 1], r[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    r[1, 0], r[1, 1], r[1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    r[2, 0], r[2, 1], r[2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    return r


@numba.njit(cache=True)
def from_matrix(r):
    """Quaternion (4,) of a rotation matrix (3, 3) float64, by its largest component (Shepperd 1978)."""
    q = np.empty(4)
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    largest, k = trace, 3
    for i in range(3):
        if r[i, i] > largest:
            largest, k = r[i, i], i
    if k == 3:
        q[3] = 1.0 + trace
        q[0], q[1], q[2] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q[k] = 1.0 + r[k, k] - r[i, i] - r[j, j]
        q[i], q[j] = r[i, k] + r[k, i], r[j, k] + r[k, j]
        q[3] = r[j, i] - r[i, j]
    return q / np.sqrt((q * q).sum())


@numba.njit(cache=True)
def principal_axis(square):
    """Eigenvector (4,) of the largest eigenvalue of a matrix (4, 4) float64, positive semidefinite.

    By repeated squaring, which costs a tenth of LAPACK's general method. If several eigenvalues are the largest to
    0.1 %, a vector of their common space; (0, 0, 0, 1) of a zero matrix.
    """
    trace = np.trace(square)
    if trace <= 0:
        return np.array([0.0, 0.0, 0.0, 1.0])
    power = square / trace
    squared = np.empty((4, 4))
    for _ in range(14):
        for i in range(4):
            for j in range(4):
                squared[i, j] = 0.0
                for k in range(4):
                    squared[i, j] += power[i, k] * power[k, j]
        power[:] = squared / np.trace(squared)
    largest = 0
    for i in range(1, 4):
        if power[i, i] > power[largest, largest]:
            largest = i
    axis = power[:, largest].copy()
    return axis / np.sqrt((axis * axis).sum())
