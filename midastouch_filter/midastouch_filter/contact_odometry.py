"""Contact odometry: how the gel moved over the object, from one penetration map to the next, without knowing where.

Where the surface that is felt has shape, two maps in a row say how the gel moved over it; where it has none (along a
plane, about the centre of a ball) the arm fills in.
"""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels
from midastouch_perception.sensor_model import SensorModel

from .noise_model import NoiseModel

_EXPLAINED = 0.95  # fit from which the start from the arm's motion is good enough


class ContactOdometry:
    """Keeps the last map and registers the next one to it.

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

    def __call__(self, penetration: np.ndarray, arm: np.ndarray) -> np.ndarray | None:
        """Motion (4, 4) of the gel over the object since the last map, None for the first one.

        penetration (H, W) float32 m; arm (4, 4), how the arm says that the gel moved since the last map.
        """
        earlier, self._map = self._map, penetration
        if earlier is not None:
            self._last = self._register(earlier, penetration, arm)
        return self._last

    def is_last(self, penetration: np.ndarray) -> bool:
        """Whether this is the very same image again, and no new touch."""
        return self._map is not None and np.array_equal(self._map, penetration)

    def _register(self, earlier: np.ndarray, later: np.ndarray, arm: np.ndarray) -> np.ndarray:
        """From the arm's motion or, if that explains the maps badly, from the last one.

        When the object slips, the gel's motion over it is nearer to the last one than to the arm's.
        """
        motion, _, fit = self._kernel.align(earlier, later, arm, self._reach, arm)
        if fit < _EXPLAINED and self._last is not None:
            other, _, other_fit = self._kernel.align(earlier, later, arm, self._reach, self._last)
            if 1 - other_fit < 0.5 * (1 - fit):
                return other
        return motion
