"""What is really there: an object on a table, which can be pushed, and a finger over it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.finger import SimulatedFinger

from ..bags.messages import BASE_FROM_OBJECT

PUSH = 6e-3, np.radians(5.0)
"""m, rad: about what the filter's test of a moved object is made for."""


class World:
    """Attributes: mesh; finger; base_from_object, T_base_obj (4, 4).

    Args: step [m], way of the finger between two images. Raises InputError if nothing of the object can be touched.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, rng: np.random.Generator, step: float):
        self._sensor, self._rng, self._step = sensor, rng, step
        self.base_from_object = BASE_FROM_OBJECT
        self.put(mesh)

    @property
    def base_from_gel(self) -> np.ndarray:
        """T_base_gel (4, 4)."""
        return self.base_from_object @ self.finger.pose

    def put(self, mesh: ObjectMesh) -> None:
        """Another object in the place of the present one, the finger over a random place of it."""
        self.finger = SimulatedFinger(mesh, self._sensor, self._rng, self._step)
        self.mesh = mesh

    def push(self) -> Iterator[np.ndarray]:
        """Move the object, 6 mm in a random direction of the gel's plane and 5 deg about its axis; the finger stays.

        Yields T_obj_gel (4, 4), one per image.
        """
        distance, angle = PUSH
        count = int(np.ceil(distance / self._step))
        direction = self._rng.uniform(0, 2 * np.pi)
        about_gel = np.array([np.cos(direction) * distance, np.sin(direction) * distance, 0, 0, 0, angle]) / count
        gel = self.finger.pose.copy()
        moved = gel @ se3.exp(about_gel) @ se3.inverse(gel)  # T_old_new of the object's frame
        for _ in range(count):
            self.base_from_object = self.base_from_object @ moved
            yield self.finger.stay_in_place(moved)
