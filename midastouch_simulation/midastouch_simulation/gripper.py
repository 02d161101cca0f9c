"""A simulated gripper without mechanics: it pinches an object, carries it, puts it down, and pinches it elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from midastouch_common import se3
from midastouch_common.frames import BASE_FROM_OBJECT
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

from .grasp import simulate_grasp

_TURNS, _CLOSES, _HOLDS = 20, 15, 20  # images
_CARRIES = 12  # images of each of the three parts of the way
_CLEAR = 0.02  # m between the open fingers and a sphere about the object
_LIFTED, _MOVED, _TURNED = 0.08, 0.05, np.radians(30.0)  # m, m, rad; the last two in the plane, at most


class Gripped(NamedTuple):
    """Gripper and object at one image. base_from_gripper, base_from_object: (4, 4); gripper_from_gels: (2, 4, 4)."""

    base_from_gripper: np.ndarray
    base_from_object: np.ndarray
    gripper_from_gels: np.ndarray


class SimulatedGripper:
    """Gripper whose two fingers move along its z axis, without limits. It starts open over its first pinch.

    Attribute: now: the last pose that was yielded.

    Parameters
    ----------
    mesh, sensor, rng

    Raises
    ------
    InputError
        The object is too small for two fingers.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, rng: np.random.Generator):
        self._mesh, self._sensor, self._rng = mesh, sensor, rng
        self._opening = mesh.diagonal + _CLEAR
        self._next()
        self.now = Gripped(BASE_FROM_OBJECT @ self._object_from_gripper, BASE_FROM_OBJECT, self._fingers(1.0))

    def pinch(self) -> Iterator[Gripped]:
        """Close, hold still, and carry the object to another place. Yields poses, one per image."""
        for fraction in np.linspace(1.0, 0.0, _CLOSES):
            yield self._moved(gripper_from_gels=self._fingers(fraction))
        for _ in range(_HOLDS):
            yield self.now
        begin, up = self.now.base_from_gripper, se3.translation([0.0, 0.0, _LIFTED])
        place = self._elsewhere()
        way = [begin, up @ begin, up @ place @ begin, place @ begin]
        gripper_from_object = se3.inverse(self._object_from_gripper)
        for start, end in pairwise(way):
            for fraction in np.linspace(1 / _CARRIES, 1.0, _CARRIES):
                gripper = _between(start, end, fraction)
                yield self._moved(base_from_gripper=gripper, base_from_object=gripper @ gripper_from_object)

    def release(self) -> Iterator[Gripped]:
        """Open, and turn about the object to the next pinch. Yields poses, one per image."""
        for fraction in np.linspace(0.0, 1.0, _CLOSES):
            yield self._moved(gripper_from_gels=self._fingers(fraction))
        gripper, fingers = self.now.base_from_gripper, self.now.gripper_from_gels
        self._next()
        goal = self.now.base_from_object @ self._object_from_gripper
        for fraction in np.linspace(1 / _TURNS, 1.0, _TURNS):
            gels = [_between(*pair, fraction) for pair in zip(fingers, self._fingers(1.0), strict=True)]
            yield self._moved(base_from_gripper=_between(gripper, goal, fraction), gripper_from_gels=np.stack(gels))

    def _next(self) -> None:
        """Choose a pinch: the gripper's z axis leads from the second gel to the first, its origin is between them."""
        gels = simulate_grasp(self._mesh, self._sensor, self._rng, contacts=2)
        first, second = gels[:, :3, 3]
        axis = (first - second) / np.linalg.norm(first - second)
        frame = se3.frame_from_normal(axis[None], np.zeros(1))[0]
        self._object_from_gripper = se3.make(frame, 0.5 * (first + second))
        self._closed = se3.inverse(self._object_from_gripper) @ gels

    def _fingers(self, fraction: float) -> np.ndarray:
        """Return the gels (2, 4, 4) in the gripper's frame, open by a fraction of the way."""
        z = fraction * self._opening
        return np.stack([se3.translation([0.0, 0.0, z]), se3.translation([0.0, 0.0, -z])]) @ self._closed

    def _elsewhere(self) -> np.ndarray:
        """Return a motion (4, 4) in the base frame: the object slid and turned on the plane it stands on."""
        x, y, turn = self._rng.uniform(-1.0, 1.0, 3) * [_MOVED, _MOVED, _TURNED]
        about = se3.translation(self.now.base_from_object[:3, 3])
        moved = se3.translation([x, y, 0.0]) @ about @ se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, turn]))
        return moved @ se3.inverse(about)

    def _moved(self, **poses: np.ndarray) -> Gripped:
        """Move what is named to these poses; return all."""
        self.now = self.now._replace(**poses)
        return self.now


def _between(start: np.ndarray, end: np.ndarray, fraction: float) -> np.ndarray:
    """Return the pose (4, 4) at a fraction of the way; the origin moves straight, while the axes turn."""
    turn = se3.log(se3.make(start[:3, :3].T @ end[:3, :3], np.zeros(3)))
    rotation = start[:3, :3] @ se3.exp(fraction * turn)[:3, :3]
    return se3.make(rotation, (1 - fraction) * start[:3, 3] + fraction * end[:3, 3])
