"""Contact odometry: how the gel moved over the object, from one penetration map to the next, without knowing where.

Where the surface that is felt has shape, two maps in a row say how the gel moved over it; where it has none (along a
plane, about the centre of a ball) a guess fills in, such as the arm's motion.
"""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels
from midastouch_perception.sensor_model import SensorModel

from ..core.noise_model import NoiseModel

_EXPLAINED = 0.95  # fit from which the start from the guess is good enough


class ContactOdometry:
    """Keeps a map and registers the next one to it.

    Args: sensor, at the resolution of the maps; noise; reach (6, 6), covariance of how far contact and arm may
    disagree.
    """

    def __init__(self, sensor: SensorModel, noise: NoiseModel, reach: np.ndarray):
        self._reach = reach
        information = sensor.pixel_area / noise.map_correlation**2 / noise.map_noise**2
        gel_depth = np.ascontiguousarray(sensor.gel_depth)
        self._kernel = kernels.MapOdometry(gel_depth, sensor.focal, sensor.gel_distance, information)
        self.restart()

    def restart(self) -> None:
        """Forget the last map: nothing is touched, or nobody knows how the arm moved."""
        self._map: np.ndarray | None = None
        self._last: np.ndarray | None = None

    def keep(self, penetration: np.ndarray, motion: np.ndarray | None) -> None:
        """The next map is registered to this one, (H, W) float32 m; motion (4, 4) that led to it, None if unknown."""
        self._map, self._last = penetration, motion

    def is_last(self, penetration: np.ndarray) -> bool:
        """Whether this map (H, W) m is of the very same image again, and no new touch."""
        return self._map is not None and np.array_equal(self._map, penetration)

    def register(self, penetration: np.ndarray, guess: np.ndarray) -> np.ndarray | None:
        """Motion (4, 4) of the gel over the object from the map that is kept to this one; None if none is kept.

        guess (4, 4): the motion where the maps say nothing. It is looked for from there or, if that explains the maps
        badly, from the last one: when the object slips, that is nearer to the truth than what the arm says.
        """
        if self._map is None:
            return None
        motion, _, fit = self._kernel.align(self._map, penetration, guess, self._reach, guess)
        if fit < _EXPLAINED and self._last is not None:
            other, _, other_fit = self._kernel.align(self._map, penetration, guess, self._reach, self._last)
            if 1 - other_fit < 0.5 * (1 - fit):
                return other
        return motion
