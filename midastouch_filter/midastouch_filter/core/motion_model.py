"""Motion model: x_t ~ x_{t-1} * N(odometry, Sigma) (paper equation 1), noise in the tangent space.

Before the particles are moved, odometry that cannot be used is refused, and motion that is too small is held back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.pose_metric import ROTATION_SCALE

from .config import FilterConfig
from .gates import Gates
from .particles import Particles
from .workers import CHUNKS, Workers

_ORTHONORMAL = 1e-3  # largest deviation of R^T R from I that still counts as a rotation


@dataclass(frozen=True)
class Odometry:
    """Motion of the sensor between two frames, `T_gel(t-1)_gel(t)`.

    transform (4, 4), its rotation orthonormal to rounding; row (7,) float32, the same as position and quaternion;
    distance m; angle rad.
    """

    transform: np.ndarray
    row: np.ndarray
    distance: float
    angle: float

    @classmethod
    def from_matrix(cls, transform: np.ndarray) -> Odometry:
        """Checked odometry (4, 4); raises ValueError saying what is wrong if it is no finite rigid transform."""
        transform = np.ascontiguousarray(transform, float)
        if transform.shape != (4, 4):
            raise ValueError(f"odometry of shape {transform.shape} instead of (4, 4)")
        if not np.isfinite(transform).all():
            raise ValueError("odometry is not finite")
        error, row, transform = kernels.decompose(transform)
        if not error < _ORTHONORMAL:
            raise ValueError("odometry is not a rigid transform")
        distance = math.hypot(*row[:3])
        angle = 2 * math.atan2(math.sqrt(row[3] ** 2 + row[4] ** 2 + row[5] ** 2), abs(row[6]))
        with np.errstate(over="ignore"):  # a jump that is never applied
            return cls(transform, row.astype(np.float32), distance, angle)

    @property
    def path(self) -> float:
        """Distance moved and turned together [m]; 1 rad counts as 10 mm."""
        return self.distance + ROTATION_SCALE * self.angle


class ExplorationNoise:
    """Fraction of the noise floor in use, in [noise_converged, 1]: all while several hypotheses compete.

    The odometry errors of an arm do not add up along the way, so the floor stands for no real error. It lets each
    mode find its best pose between the coarse poses of the codebook, without which chance decides which mode
    survives; once one mode holds most of the weight it only blurs the answer, and is annealed.
    """

    _RATE = 0.3  # change per independent touch

    def __init__(self, config: FilterConfig):
        self._config = config
        self.fraction = 1.0

    def update(self, dominant_mass: float, tempering: float) -> None:
        """After a touch, counted as `tempering` of an independent one."""
        step = 1.0 - self._RATE * tempering
        if dominant_mass >= self._config.converged_mass:
            self.fraction = max(self.fraction * step, self._config.noise_converged)
        else:
            self.fraction = min(self.fraction / step, 1.0)


class MotionModel:
    """Moves particles by odometry and noise.

    Noise is drawn from streams seeded once from `rng`, one per range of particles, so that it does not depend on the
    number of threads.
    """

    def __init__(self, config: FilterConfig, rng: np.random.Generator, workers: Workers):
        self._config, self._workers = config, workers
        self._streams = [kernels.NormalStream(seed) for seed in rng.integers(2**63, size=CHUNKS).tolist()]

    def propagate(self, particles: Particles, odometry: Odometry, exploration: float) -> None:
        """Apply equation 1 in place: every particle moves by the odometry, then by its own noise.

        The noise has a floor, scaled by `exploration` in [0, 1] (see `ExplorationNoise`).
        """
        c = self._config
        sigma_t = c.noise_per_metre * odometry.distance + exploration * c.noise_translation
        sigma_r = c.noise_per_radian * odometry.angle + exploration * c.noise_rotation
        self._move(particles, odometry, [sigma_t] * 3 + [sigma_r] * 3)

    def scatter(self, particles: Particles, spacing: float) -> None:
        """Spread particles in place along the surface, by about the distance `spacing` [m] between them.

        The gel frame's x and y lie along the surface, and z is its normal: so the noise is in x, y and yaw.
        """
        along = 0.25 * spacing
        self._move(particles, Odometry.from_matrix(np.eye(4)), [along, along, 0, 0, 0, along / ROTATION_SCALE])

    def blur(self, particles: Particles, covariance: np.ndarray) -> None:
        """Spread particles in place by a covariance (6, 6) in their own frames, m^2 and rad^2, axis by axis."""
        self._move(particles, Odometry.from_matrix(np.eye(4)), np.sqrt(np.diag(covariance)))

    def _move(self, particles: Particles, odometry: Odometry, sigma: Sequence[float]) -> None:
        # a turn by w is the quaternion (w/2, 1), normalised
        scale = np.array([*sigma[:3], *(0.5 * angle for angle in sigma[3:])], np.float32)
        noisy = any(sigma)
        self._workers.run(
            len(particles),
            lambda low, high, chunk: kernels.compose(
                low, high, particles.positions, particles.quaternions, odometry.row, scale,
                self._streams[chunk] if noisy else None,
            ),
        )  # fmt: skip


def transformed(particles: Particles, transform: np.ndarray, workers: Workers) -> Particles:
    """The poses of another frame, that lies at `transform` (4, 4) in each particle's; weights and entries shared."""
    row = Odometry.from_matrix(transform).row
    positions, quaternions = particles.positions.copy(), particles.quaternions.copy()
    still = np.zeros(6, np.float32)
    workers.run(
        len(particles),
        lambda low, high, _: kernels.compose(low, high, positions, quaternions, row, still, None),
    )
    return Particles(positions, quaternions, particles.log_weights, particles.entries)


class RestGate:
    """Holds back motion that is too small to matter; small steps add up, so that slow creeping is not lost.

    Args: config; gates, which counts what is held back as `at_rest`.
    """

    def __init__(self, config: FilterConfig, gates: Gates):
        self._config, self._gates = config, gates
        self.reset()

    def motion(self, odometry: Odometry) -> Odometry | None:
        """All motion since the last that was handed on, or None while it is too small."""
        total = odometry
        if self._pending is not None:
            total = Odometry.from_matrix(self._pending @ odometry.transform)
        moving = total.distance > self._config.update_min_d or total.angle > self._config.update_min_a
        held = self._gates.skips("at_rest", not moving)
        self._pending = total.transform if held else None
        return None if held else total

    def reset(self) -> None:
        """Forget small steps held back, because the particles were drawn anew."""
        self._pending: np.ndarray | None = None


class OdometryJump(ValueError):
    """The odometry jumped: the gel's pose is unknown; the particles were not moved."""


class Propagation:
    """Moves particles by measured odometry and noise; in the air there is no noise floor."""

    def __init__(self, model: MotionModel, config: FilterConfig, gates: Gates):
        self._model, self._config, self._gates = model, config, gates
        self._rest = RestGate(config, gates)
        self.restart()

    def restart(self) -> None:
        """The particles were drawn anew."""
        self._rest.reset()
        self._exploration = ExplorationNoise(self._config)

    def explore(self, dominant_mass: float, tempering: float) -> None:
        """Adapt the noise floor after a touch that counts as the fraction `tempering` of an independent one."""
        self._exploration.update(dominant_mass, tempering)

    def blur(self, particles: Particles, covariance: np.ndarray) -> None:
        """Spread particles in place: where they are is known no better than to a covariance (6, 6), own frame."""
        self._model.blur(particles, covariance)

    def __call__(self, particles: Particles, odometry: np.ndarray | None, in_contact: bool) -> Odometry | None:
        """Move particles in place; the motion, None at rest or if the odometry is refused. Raises OdometryJump."""
        if odometry is None:
            return None
        try:
            motion = Odometry.from_matrix(odometry)
        except ValueError as error:
            self._gates.refuse("bad_odometry", str(error))
            return None
        if motion.distance > self._config.max_odometry_jump:
            raise OdometryJump(f"odometry jumped by {motion.distance:.2f} m")
        motion = self._rest.motion(motion)
        if motion is not None:
            self._model.propagate(particles, motion, self._exploration.fraction if in_contact else 0.0)
        return motion
