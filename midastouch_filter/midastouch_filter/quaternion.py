"""Quaternion arithmetic for Numba kernels. Quaternions are xyzw and unit; everything is float32 scalars."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, inline="always")
def multiply(ax, ay, az, aw, bx, by, bz, bw):
    """Hamilton product a * b."""
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@numba.njit(cache=True, inline="always")
def rotate(qx, qy, qz, qw, x, y, z):
    """Vector (x, y, z) turned by the quaternion: v + 2 w (u x v) + 2 u x (u x v)."""
    two = np.float32(2.0)
    tx, ty, tz = two * (qy * z - qz * y), two * (qz * x - qx * z), two * (qx * y - qy * x)
    return (
        x + qw * tx + qy * tz - qz * ty,
        y + qw * ty + qz * tx - qx * tz,
        z + qw * tz + qx * ty - qy * tx,
    )
