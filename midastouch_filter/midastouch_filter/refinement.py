"""Coarse to fine: once particles form narrow modes, let the felt relief itself place them.

The codebook is as fine as its entries, about 4 mm and 20 deg apart. A narrow mode is close to a Gaussian, and for a
Gaussian the relief has a closed-form update: `alignment.py` gives the posterior mean and covariance, and the mode's
particles are moved as a whole so that they have them (a deterministic ensemble Kalman update, Bishop et al. 2001).
It costs a dozen rendered views per mode instead of one per particle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

from .alignment import Aligned, ReliefAlignment, without_jitter
from .config import FilterConfig
from .estimate import Mode
from .particles import Particles
from .workers import Workers

RELIEF_SCALE = 0.25  # of the camera image: 80 x 60
_FLOOR = np.repeat([2e-4, np.radians(0.3)], 3) ** 2  # m^2, rad^2: no mode is surer than this before it is aligned
_LARGEST_EVIDENCE = 5.0  # nats one relief may speak for one mode and against another


def reduced_relief(penetration: np.ndarray) -> np.ndarray:
    """Relief (80, 60) float32 m of a penetration map whose sides are multiples of that, by block means."""
    rows, columns = penetration.shape[0] // 80, penetration.shape[1] // 60
    return np.ascontiguousarray(penetration.reshape(80, rows, 60, columns).mean(axis=(1, 3)), np.float32)


class Refinement:
    """Moves the particles of narrow modes to where the relief puts them."""

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, config: FilterConfig, workers: Workers):
        self._config, self._workers = config, workers
        self.alignment = ReliefAlignment(
            mesh, sensor.scaled(RELIEF_SCALE), config.relief_noise, config.relief_correlation
        )
        self._jitter = config.jitter

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the reliefs."""
        return self.alignment.sensor.gel_depth.shape

    def apply(
        self, particles: Particles, members: np.ndarray, modes: list[Mode], relief: np.ndarray, share: float
    ) -> dict[int, Aligned]:
        """Update the particles of narrow modes in place; returns what the relief says of each of them, by mode.

        members (N,): mode of each particle, -1 for none; relief (80, 60) m; share in [0, 1]: how much of this frame
        is evidence independent of the last. Between several narrow modes, mass moves to those the relief fits.
        """
        c = self._config
        narrow = [k for k, mode in enumerate(modes[: c.refined_modes]) if self.is_narrow(mode)]
        priors = {k: _in_own_frame(modes[k]) + np.diag(_FLOOR) for k in narrow}
        posteriors = self._workers.map(
            lambda k: self.alignment.align(modes[k].pose, priors[k] + self._jitter, relief), narrow
        )
        aligned = dict(zip(narrow, posteriors, strict=True))
        for k, posterior in aligned.items():
            if posterior.fit > c.relief_fit:
                mean, covariance = without_jitter(modes[k].pose, priors[k], self._jitter, posterior)
                _move(particles, np.flatnonzero(members == k), modes[k].pose, priors[k], mean, covariance)
        if len(aligned) > 1:
            self._weigh(particles, members, aligned, share)
        return aligned

    def is_narrow(self, mode: Mode) -> bool:
        """Whether the mode is close enough to a Gaussian to be aligned."""
        c = self._config
        return mode.spread_translation < c.refine_translation and mode.spread_rotation < c.refine_rotation

    @staticmethod
    def _weigh(particles: Particles, members: np.ndarray, aligned: dict[int, Aligned], share: float) -> None:
        best = max(a.log_evidence for a in aligned.values())
        concerned = np.isin(members, list(aligned))
        before = np.logaddexp.reduce(particles.log_weights[concerned])
        for k, posterior in aligned.items():
            change = share * max(posterior.log_evidence - best, -_LARGEST_EVIDENCE)
            particles.log_weights[members == k] += change
        particles.log_weights[concerned] += before - np.logaddexp.reduce(particles.log_weights[concerned])


def sharpened(mode: Mode, aligned: Aligned) -> Mode:
    """The mode with the pose of this very frame: where the relief puts the sensor, the arm's jitter included."""
    turn = np.kron(np.eye(2), aligned.pose[:3, :3])
    return replace(mode, pose=aligned.pose, covariance=turn @ aligned.covariance @ turn.T)


def _in_own_frame(mode: Mode) -> np.ndarray:
    """A mode's covariance (6, 6) in its pose's own axes instead of the object's."""
    turn = np.kron(np.eye(2), mode.pose[:3, :3])
    return turn.T @ mode.covariance @ turn


def _move(
    particles: Particles,
    which: np.ndarray,
    pose: np.ndarray,
    prior: np.ndarray,
    mean: np.ndarray,
    covariance: np.ndarray,
) -> None:
    """Map particles spread as N(pose, prior) to N(mean, covariance), by the affine map of their Cholesky factors."""
    shrink = np.linalg.cholesky(covariance) @ np.linalg.inv(np.linalg.cholesky(prior))
    turn = Rotation.from_matrix(pose[:3, :3])
    deviation = np.empty((len(which), 6))
    deviation[:, :3] = (particles.positions[which] - pose[:3, 3]) @ pose[:3, :3]
    deviation[:, 3:] = (turn.inv() * Rotation.from_quat(particles.quaternions[which])).as_rotvec()
    deviation = deviation @ shrink.T
    particles.positions[which] = mean[:3, 3] + deviation[:, :3] @ mean[:3, :3].T
    turned = Rotation.from_matrix(mean[:3, :3]) * Rotation.from_rotvec(deviation[:, 3:])
    particles.quaternions[which] = turned.as_quat()
