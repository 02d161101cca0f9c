"""A simulated finger over an object: the arm without mechanics, which carries out acts at once."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

import numpy as np

from midastouch_common import se3
from midastouch_common.frames import BASE_FROM_OBJECT
from midastouch_common.mesh import ObjectMesh
from midastouch_motion.exploration.acts import Act, Approach, Done, Lift, Plan, Slide, Touch, carried_out
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.finger import Motion, SimulatedFinger

PUSH = 6e-3, np.radians(5.0)
"""m, rad; about the motion that the filter's test of a moved object is made for."""

_T = TypeVar("_T")


class World:
    """Simulated finger and object.

    Attributes: mesh; finger; base_from_object: T_base_obj (4, 4).

    Parameters
    ----------
    mesh, sensor, rng
    step : path of the finger between two images [m]

    Raises
    ------
    InputError
        Nothing of the object can be touched.
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
        """Put another object in place of the present one, with the finger over a random point of it."""
        self.finger = SimulatedFinger(mesh, self._sensor, self._rng, self._step)
        self.mesh = mesh

    def push(self) -> Generator[np.ndarray, None, None]:
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

    def follow(self, plan: Plan[_T]) -> Generator[np.ndarray, None, _T]:
        """Carry out a plan; yields T_obj_gel (4, 4), one per image, and returns the plan's result."""
        return (yield from carried_out(plan, self.carry_out))  # type: ignore[arg-type] # only of acts

    def carry_out(self, act: Act) -> Generator[np.ndarray, None, Done]:
        """Carry out an act; yields T_obj_gel (4, 4), one per image, and returns how it ended."""
        motion, last, path = self._motion(act), self.finger.pose[:3, 3], 0.0
        while True:
            try:
                pose = next(motion)
            except StopIteration as end:
                success = end.value
                break
            path += float(np.linalg.norm(pose[:3, 3] - last))
            last = pose[:3, 3]
            yield pose
        return Done(success, _words(act, success, path), path, self.finger.touching, self.base_from_gel)

    def _motion(self, act: Act) -> Motion:
        match act:
            case Touch(distance, direction):
                return self.finger.touch(distance, np.array(direction))
            case Slide(heading, length):
                return self.finger.slide(heading, length)
            case Lift(height):
                return self.finger.lift(height)
            case Approach(pose):
                return self.finger.approach(se3.inverse(self.base_from_object) @ pose)


def _words(act: Act, success: bool, path: float) -> str:
    """Describe how an act ended, after a path [m]."""
    way = f"{1e3 * path:.0f} mm"
    match act:
        case Touch(distance):
            return "touches" if success else f"nothing on which it fits touched within {1e3 * distance:.0f} mm"
        case Slide():
            return f"slid {way}" if success else f"it could not move on after {way}"
        case Lift():
            return f"lifted by {way}" if success else f"something was in the way after {way}"
        case Approach():
            return f"there, after {way}" if success else f"touched on the way after {way}"
