"""Motion model: x_t ~ x_{t-1} * N(odometry, Sigma) (paper equation 1), noise in the tangent space."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from midastouch_perception import se3

from . import quaternion
from .config import FilterConfig
from .lookup import ROTATION_SCALE
from .particles import Particles
from .workers import CHUNKS, Workers

_ORTHONORMAL = 1e-3  # largest deviation of R^T R from I that still counts as a rotation


@dataclass(frozen=True)
class Odometry:
    """Motion of the sensor between two frames, `T_gel(t-1)_gel(t)`: matrix (4, 4), distance m, angle rad."""

    transform: np.ndarray
    distance: float
    angle: float

    @classmethod
    def from_matrix(cls, transform: np.ndarray) -> Odometry:
        """Checked odometry; raises ValueError saying what is wrong if it is no finite rigid transform."""
        transform = np.asarray(transform, float)
        if transform.shape != (4, 4):
            raise ValueError(f"odometry of shape {transform.shape} instead of (4, 4)")
        if not np.isfinite(transform).all():
            raise ValueError("odometry is not finite")
        rotation = transform[:3, :3]
        if np.abs(rotation.T @ rotation - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(rotation) < 0:
            raise ValueError("odometry is not a rigid transform")
        return cls(transform, float(np.linalg.norm(transform[:3, 3])), float(se3.rotation_angle(rotation)))

    @property
    def path(self) -> float:
        """Distance moved and turned together [m]; 1 rad counts as 10 mm."""
        return self.distance + ROTATION_SCALE * self.angle


class MotionModel:
    """Moves particles by odometry and noise.

    Noise is drawn from generators spawned once from `rng`, one per range of particles, so that it does not
    depend on the number of threads.
    """

    def __init__(self, config: FilterConfig, rng: np.random.Generator, workers: Workers):
        self._config, self._workers = config, workers
        self._streams = rng.spawn(CHUNKS)

    def propagate(self, particles: Particles, odometry: Odometry, in_contact: bool) -> None:
        """Apply equation 1 in place: every particle moves by the odometry, then by its own noise.

        The noise has a floor that keeps duplicates of resampling apart; it is left out in the air, where no
        touch corrects it.
        """
        c = self._config
        sigma_t = c.noise_per_metre * odometry.distance + (c.noise_translation if in_contact else 0.0)
        sigma_r = c.noise_per_radian * odometry.angle + (c.noise_rotation if in_contact else 0.0)
        self._move(particles, odometry.transform, np.repeat([sigma_t, sigma_r], 3))

    def scatter(self, particles: Particles, spacing: float) -> None:
        """Spread particles in place along the surface, by about the distance `spacing` [m] between them.

        The gel frame's x and y lie along the surface, and z is its normal: so the noise is in x, y and yaw.
        """
        sigma = 0.25 * spacing
        self._move(particles, np.eye(4), np.array([sigma, sigma, 0, 0, 0, sigma / ROTATION_SCALE]))

    def _move(self, particles: Particles, transform: np.ndarray, sigma: np.ndarray) -> None:
        step = se3.to_xyzquat(transform).astype(np.float32)
        noisy = bool(sigma.any())
        # a turn by w is the quaternion (w/2, 1), normalised
        scale = (sigma * [1, 1, 1, 0.5, 0.5, 0.5]).astype(np.float32)
        noise = np.empty((len(particles) if noisy else 0, 6), np.float32)

        def kernel(low: int, high: int, chunk: int) -> None:
            if noisy:
                self._streams[chunk].standard_normal(out=noise[low:high], dtype=np.float32)
            _compose(
                low, high, particles.positions, particles.quaternions, step, noise, noisy, scale
            )

        self._workers.run(len(particles), kernel)


@numba.njit(cache=True, nogil=True)
def _compose(low, high, positions, quaternions, step, noise, noisy, scale):
    one = np.float32(1.0)
    for i in range(low, high):
        qx, qy, qz, qw = quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3]
        x, y, z = quaternion.rotate(qx, qy, qz, qw, step[0], step[1], step[2])
        x, y, z = positions[i, 0] + x, positions[i, 1] + y, positions[i, 2] + z
        qx, qy, qz, qw = quaternion.multiply(qx, qy, qz, qw, step[3], step[4], step[5], step[6])
        if noisy:
            dx, dy, dz = quaternion.rotate(
                qx, qy, qz, qw, scale[0] * noise[i, 0], scale[1] * noise[i, 1], scale[2] * noise[i, 2]
            )
            x, y, z = x + dx, y + dy, z + dz
            qx, qy, qz, qw = quaternion.multiply(
                qx, qy, qz, qw, scale[3] * noise[i, 3], scale[4] * noise[i, 4], scale[5] * noise[i, 5], one
            )
        shrink = one / np.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
        positions[i, 0], positions[i, 1], positions[i, 2] = x, y, z
        quaternions[i, 0], quaternions[i, 1] = qx * shrink, qy * shrink
        quaternions[i, 2], quaternions[i, 3] = qz * shrink, qw * shrink
