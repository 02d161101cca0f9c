"""Frame-to-frame odometry alone: the start, moved as the arm says. What touch is worth is the distance to this."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import geodesic_distances
from midastouch_filter.core import initialisation
from midastouch_filter.core.estimate import Estimate, Mode
from midastouch_filter.core.gates import Stopwatch
from midastouch_filter.core.state import CONVERGED, UNINITIALISED, Status

if TYPE_CHECKING:
    from midastouch_filter.core.touch import Measurement
    from midastouch_perception.codebook import Codebook


@dataclass(frozen=True)
class OdometryConfig:
    """Nothing to choose."""


class DeadReckoning:
    """One pose `T_obj_gel`, with the interface of `ParticleFilter`; it never doubts.

    It starts at one draw of the start, at the nearest codebook pose: at the prior's middle it would be told the answer.
    Args: mesh, codebook, config, clock as `ParticleFilter`.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        codebook: Codebook,
        config: OdometryConfig | None = None,
        clock: Callable[[], float] = lambda: 0.0,
    ):
        self._book, self._clock, self._diagonal = np.asarray(codebook.poses, float), clock, mesh.diagonal
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Forget everything but the object."""
        self._rng = np.random.default_rng(seed)
        self._pose: np.ndarray | None = None
        self._covariance = np.eye(6)
        self._state = UNINITIALISED

    def initialise_uniform(self) -> None:
        """Start anywhere on the surface."""
        entry = initialisation.uniform_entries(len(self._book), 1, self._rng)[0]
        self._start(self._book[entry], self._diagonal, np.pi)

    def initialise_gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start at a draw around a prior `T_obj_gel` (4, 4) with sigma_t [m] and sigma_r [rad] per axis."""
        drawn = initialisation.gaussian_poses(prior, sigma_t, sigma_r, 1, self._rng)[0]
        self._start(self._book[np.argmin(geodesic_distances(self._book, drawn))], sigma_t, sigma_r)

    def _start(self, pose: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        self._pose, self._state = pose.copy(), CONVERGED
        self._covariance = np.diag(np.repeat([sigma_t, sigma_r], 3) ** 2)

    def step(self, odometry: np.ndarray | None, measurement: Measurement, elapsed: float | None = None) -> Estimate:
        """Move by `inv(p_prev) p_now` (4, 4), None on the first frame; elapsed is of no use to it."""
        if self._pose is None:
            return Estimate([], Status(self._state, "no start given yet"))
        watch = Stopwatch(self._clock)
        with watch.stage("motion"):
            if odometry is not None:
                self._pose = self._pose @ odometry
        with watch.stage("look"):
            self._look(odometry, measurement)
        status = Status(self._state, "one answer", n_particles=1, ess=1.0, n_modes=1, mode_mass=1.0, ms=watch.ms)
        return Estimate([Mode(1.0, self._pose, self._covariance, 1)], status, self._covariance)

    def _look(self, odometry: np.ndarray | None, measurement: Measurement) -> None:
        """What is felt changes nothing."""

    @property
    def poses(self) -> np.ndarray:
        """The pose (1, 4, 4); (0, 4, 4) before a start."""
        return np.empty((0, 4, 4)) if self._pose is None else self._pose[None]

    @property
    def weights(self) -> np.ndarray:
        """(1,) or (0,)."""
        return np.ones(len(self.poses))
