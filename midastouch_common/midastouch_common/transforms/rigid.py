"""Rigid transforms as seven numbers, [x y z qx qy qz qw], and the error of checking them and looking them up.

On so few numbers, NumPy and SciPy cost 10-100 times the arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

Pose = tuple[float, float, float, float, float, float, float]

IDENTITY: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)

# How far a squared quaternion norm may be from 1: the tolerance of tf2 in ROS 1; that of ROS 2 normalises anything.
_UNIT_TOLERANCE = 1e-2


class TransformError(Exception):
    """A transform is invalid, or not known at a stamp; the message names the frames and the reason."""


def rotate(q: tuple[float, ...], x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector turned by the unit quaternion [qx qy qz qw]."""
    qx, qy, qz, qw = q
    cx, cy, cz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return (x + qw * cx + qy * cz - qz * cy, y + qw * cy + qz * cx - qx * cz, z + qw * cz + qx * cy - qy * cx)


def multiply(a: Pose, b: Pose) -> Pose:
    """Return T_a @ T_b."""
    ax, ay, az, aw = a[3:]
    bx, by, bz, bw = b[3:]
    x, y, z = rotate(a[3:], *b[:3])
    return (
        a[0] + x,
        a[1] + y,
        a[2] + z,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def invert(pose: Pose) -> Pose:
    """Return the inverse transform."""
    conjugate = (-pose[3], -pose[4], -pose[5], pose[6])
    x, y, z = rotate(conjugate, *pose[:3])
    return (-x, -y, -z, *conjugate)


def interpolate(start: Pose, end: Pose, fraction: float) -> Pose:
    """Interpolate linearly in translation and spherically in rotation, along the shorter arc."""
    a, b = start[3:], end[3:]
    if sum(u * v for u, v in zip(a, b, strict=True)) < 0:
        b = (-b[0], -b[1], -b[2], -b[3])
    # half-angle form: accurate for tiny angles, where acos of the scalar product is not
    apart = math.sqrt(sum((u - v) ** 2 for u, v in zip(a, b, strict=True)))
    together = math.sqrt(sum((u + v) ** 2 for u, v in zip(a, b, strict=True)))
    angle = 2 * math.atan2(apart, together)
    if angle < 1e-9:
        weight_a, weight_b = 1 - fraction, fraction
    else:
        weight_a = math.sin((1 - fraction) * angle) / math.sin(angle)
        weight_b = math.sin(fraction * angle) / math.sin(angle)
    x, y, z = (u + fraction * (v - u) for u, v in zip(start[:3], end[:3], strict=True))
    qx, qy, qz, qw = (weight_a * u + weight_b * v for u, v in zip(a, b, strict=True))
    return x, y, z, qx, qy, qz, qw


def to_matrix(pose: Pose) -> np.ndarray:
    """Return the transform (4, 4)."""
    x, y, z, qx, qy, qz, qw = pose
    scale = 2.0 / (qx * qx + qy * qy + qz * qz + qw * qw)
    return np.array(
        [
            [1 - scale * (qy * qy + qz * qz), scale * (qx * qy - qz * qw), scale * (qx * qz + qy * qw), x],
            [scale * (qx * qy + qz * qw), 1 - scale * (qx * qx + qz * qz), scale * (qy * qz - qx * qw), y],
            [scale * (qx * qz - qy * qw), scale * (qy * qz + qx * qw), 1 - scale * (qx * qx + qy * qy), z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def checked_pose(parent: str, child: str, pose: Sequence[float]) -> Pose:
    """Return the pose [x y z qx qy qz qw] of one frame in another with a unit quaternion.

    Raises TransformError with the fix if it holds NaN or infinite values, if the quaternion is far from unit
    length, or if the frames are not two.
    """
    if not parent or not child or parent == child:
        fault = "needs two different frame names; fix its publisher"
    elif not math.isfinite(sum(pose)):
        fault = "holds NaN or infinite values; fix its publisher"
    else:
        x, y, z, qx, qy, qz, qw = pose
        square = qx * qx + qy * qy + qz * qz + qw * qw
        norm = math.sqrt(square)
        if abs(square - 1.0) <= _UNIT_TOLERANCE:
            return x, y, z, qx / norm, qy / norm, qz / norm, qw / norm
        kind = "zero" if norm < 1e-6 else "not a unit quaternion"
        fault = f"rotation is {kind} (norm {norm:.6g}); normalise it"
    raise TransformError(f"transform '{parent}' -> '{child}': {fault}")
