"""Batches of rigid transforms.

A transform `T_a_b` is a (..., 4, 4) float64 array that maps coordinates of frame b into frame a. Quaternions
are xyzw (ROS, SciPy). Tangent vectors are [rho, omega]: translation part first, metres and radians, in the
moving frame (right perturbation): `T @ exp(xi)`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

import midastouch_kernels as kernels

from .errors import InputError


def make(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> np.ndarray:
    """Make transforms from rotations and translations, which broadcast.

    Parameters
    ----------
    rotation : (..., 3, 3)
    translation : (..., 3)

    Returns
    -------
    (..., 4, 4)
    """
    rotation, translation = np.asarray(rotation, float), np.asarray(translation, float)
    shape = np.broadcast_shapes(rotation.shape[:-2], translation.shape[:-1])
    out = np.zeros((*shape, 4, 4))
    out[..., :3, :3] = rotation
    out[..., :3, 3] = translation
    out[..., 3, 3] = 1.0
    return out


def translation(vector: npt.ArrayLike) -> np.ndarray:
    """Return transforms (..., 4, 4) that shift by vectors (..., 3) m; `T @ translation(v)` moves T along T's axes."""
    return make(np.eye(3), vector)


def from_xyzquat(vector: npt.ArrayLike) -> np.ndarray:
    """Convert rows of position and quaternion to transforms.

    Parameters
    ----------
    vector
        Rows [x y z qx qy qz qw] (..., 7) [m]; quaternions need not be unit.

    Returns
    -------
    (..., 4, 4) float64

    Raises
    ------
    InputError
        Other shape, non-finite values, or a quaternion shorter than 1e-6.
    """
    vector = np.asarray(vector, float)
    if vector.shape[-1:] != (7,):
        raise InputError(f"poses must be rows of 7 values [x y z qx qy qz qw], got shape {vector.shape}")
    if not np.isfinite(vector).all():
        raise InputError("pose with a non-finite value; drop the row that holds it")
    if (np.linalg.norm(vector[..., 3:], axis=-1) < 1e-6).any():
        raise InputError("pose with a zero quaternion; drop the row that holds it")
    flat = vector.reshape(-1, 7)
    return make(_matrices(flat[:, 3:]), flat[:, :3]).reshape((*vector.shape[:-1], 4, 4))


def to_xyzquat(transform: npt.ArrayLike) -> np.ndarray:
    """Return rows [x y z qx qy qz qw] (..., 7) of transforms (..., 4, 4)."""
    transform = np.asarray(transform, float)
    flat = np.ascontiguousarray(transform.reshape(-1, 4, 4))
    return np.concatenate([flat[:, :3, 3], kernels.quaternions(flat)], axis=1).reshape((*transform.shape[:-2], 7))


def inverse(transform: npt.ArrayLike) -> np.ndarray:
    """Return inverse transforms (..., 4, 4), by transposition of the rotation."""
    transform = np.asarray(transform, float)
    return kernels.inverses(np.ascontiguousarray(transform.reshape(-1, 4, 4))).reshape(transform.shape)


def exp(xi: npt.ArrayLike) -> np.ndarray:
    """Apply the exponential map: tangent vectors (..., 6) [rho, omega] to transforms (..., 4, 4)."""
    xi = np.asarray(xi, float)
    return kernels.exponentials(np.ascontiguousarray(xi.reshape(-1, 6))).reshape((*xi.shape[:-1], 4, 4))


def log(transform: npt.ArrayLike) -> np.ndarray:
    """Apply the logarithm map: transforms (..., 4, 4) to tangent vectors (..., 6) [rho, omega]; angle in [0, pi]."""
    transform = np.asarray(transform, float)
    return kernels.logarithms(np.ascontiguousarray(transform.reshape(-1, 4, 4))).reshape((*transform.shape[:-2], 6))


def odometry(poses: Iterable[np.ndarray]) -> Iterator[np.ndarray | None]:
    """Yield the motion (4, 4) of each pose (4, 4) since the last one, `inv(T_before) T_now`; None for the first."""
    before = None
    for pose in poses:
        yield None if before is None else inverse(before) @ pose
        before = pose


def turn(rotation: np.ndarray) -> np.ndarray:
    """Return the matrix (6, 6) that rotates both parts of a tangent vector by a rotation (3, 3)."""
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = rotation
    return out


def rotation_angle(rotation: npt.ArrayLike) -> np.ndarray:
    """Return the geodesic angle (...) [rad] of rotation matrices (..., 3, 3), in [0, pi] and accurate at both ends."""
    rotation = np.asarray(rotation, float)
    cosine = (np.trace(rotation, axis1=-2, axis2=-1) - 1) / 2
    axis = rotation[..., [2, 0, 1], [1, 2, 0]] - rotation[..., [1, 2, 0], [2, 0, 1]]
    return np.arctan2(np.linalg.norm(axis, axis=-1) / 2, cosine)


def random_rotations(n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw rotation matrices, uniform over SO(3).

    Parameters
    ----------
    n, rng

    Returns
    -------
    (n, 3, 3)
    """
    return _matrices(rng.standard_normal((n, 4)))


def _matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return rotation matrices (N, 3, 3) of quaternions (N, 4) of any length."""
    if not len(quaternions):  # SciPy of Ubuntu 24.04 (1.11) refuses an empty array
        return np.empty((0, 3, 3))
    return Rotation.from_quat(quaternions).as_matrix()


def frame_from_normal(normals: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Make rotations with a given z axis.

    The frame before the yaw is the branch-free construction of Duff et al. 2017, which has no singular direction (the
    official code's fallback near the poles tilts poses by up to 26 degrees).

    Parameters
    ----------
    normals : (N, 3) unit vectors, the z axes
    yaw : (N,) turns about them [rad]

    Returns
    -------
    (N, 3, 3)
    """
    n = np.asarray(normals, float)
    sign = np.copysign(1.0, n[:, 2])
    a = -1.0 / (sign + n[:, 2])
    b = n[:, 0] * n[:, 1] * a
    x = np.stack([1 + sign * n[:, 0] ** 2 * a, sign * b, -sign * n[:, 0]], axis=1)
    y = np.stack([b, sign + n[:, 1] ** 2 * a, -n[:, 1]], axis=1)
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    return np.stack([c * x + s * y, -s * x + c * y, n], axis=2)
