"""Equation 1 of the paper, with what comes before it: can the odometry be used, and does the arm move at all?"""

from __future__ import annotations

import numpy as np

from .config import FilterConfig
from .gates import Gates, RestGate
from .motion_model import Exploration, MotionModel, Odometry
from .particles import Particles


class OdometryJump(ValueError):
    """The odometry jumped: the particles are where they were, and nobody knows where that is now."""


class Propagation:
    """Moves particles by measured odometry and noise; in the air there is no noise floor."""

    def __init__(self, model: MotionModel, config: FilterConfig, gates: Gates):
        self._model, self._config, self._gates = model, config, gates
        self._rest = RestGate(config, gates)
        self.restart()

    def restart(self) -> None:
        """The particles were drawn anew."""
        self._rest.reset()
        self._exploration = Exploration(self._config)

    def explore(self, dominant_mass: float, tempering: float) -> None:
        """Adapt the noise floor after a touch, counted as `tempering` of an independent one."""
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
            self._model.propagate(particles, motion, self._exploration.share if in_contact else 0.0)
        return motion
