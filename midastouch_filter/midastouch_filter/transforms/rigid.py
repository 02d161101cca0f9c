"""Is what is offered as a transform a rigid one?"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from .errors import InvalidTransformError
from .scalar_pose import Pose

# How far a squared quaternion norm or a rotation's Gram matrix may be from the identity: tf2's own tolerance.
_UNIT_TOLERANCE = 1e-2


def checked_pose(transform: np.ndarray | Sequence[float]) -> Pose:
    """A (4, 4) matrix or [x y z qx qy qz qw] as a pose with a unit quaternion; InvalidTransformError if it is none."""
    if isinstance(transform, np.ndarray):
        if transform.shape == (4, 4):
            return _pose_of_matrix(transform)
        transform = transform.tolist()
    if len(transform) != 7:
        raise InvalidTransformError(f"expected a (4, 4) matrix or 7 values, got shape {np.shape(transform)}")
    if not all(map(math.isfinite, transform)):
        raise InvalidTransformError("holds NaN or infinite values; mend its publisher")
    x, y, z, qx, qy, qz, qw = transform
    square = qx * qx + qy * qy + qz * qz + qw * qw
    norm = math.sqrt(square)
    if abs(square - 1.0) > _UNIT_TOLERANCE:
        kind = "zero" if norm < 1e-6 else "not a unit quaternion"
        raise InvalidTransformError(f"rotation is {kind} (norm {norm:.6g}); normalise it")
    return x, y, z, qx / norm, qy / norm, qz / norm, qw / norm


def _pose_of_matrix(matrix: np.ndarray) -> Pose:
    if not np.isfinite(matrix).all():
        raise InvalidTransformError("holds NaN or infinite values; mend its publisher")
    rotation = matrix[:3, :3]
    rigid = np.abs(rotation @ rotation.T - np.eye(3)).max() < _UNIT_TOLERANCE and np.linalg.det(rotation) > 0
    if not rigid or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-9:
        raise InvalidTransformError("the matrix is not rigid; orthonormalise its rotation")
    return (*matrix[:3, 3].tolist(), *Rotation.from_matrix(rotation).as_quat().tolist())
