"""Simulated finger that an arm moves over an object: it touches, slides, lifts, and moves through the air."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.surface_walk import MIN_PROGRESS, carried, straight_on
from midastouch_perception.rendering.contact_poses import Reachability
from midastouch_perception.sensor_model import SensorModel

from .slide import Grip, pressed_pose, somewhere

_PRESS, _MAX_TILT = (0.5e-3, 1e-3), np.radians(5.0)  # of simulated slides
_LIFTING, _IN_AIR = 2, 4  # times as fast as on the surface
_CLEARANCES = (4e-3, 8e-3, 24e-3)  # m over the surface, tried in this order, from which it comes down flat
_GRAZES = 2e-4  # m of penetration that does not stop it on its way through the air
_BEFORE = 8e-3  # m over the surface at the start
_COMING = np.array([0.0, 0.0, 0.08])  # m, offset in the gel frame from which it came to the start
_TRIES = 64

Motion = Generator[np.ndarray, None, bool]


class SimulatedFinger:
    """Simulated finger, which starts over a random position of the object.

    Its motions yield poses T_obj_gel (4, 4), one per image, and return whether they were completed. Two poses are
    `step` m apart on the surface, four times as far in the air. The gel keeps its direction in the surface, as at the
    end of an arm that does not twist.

    Attributes: pose T_obj_gel (4, 4), the newest; touching, true while the finger is pressed on.
    Raises InputError if no part of the object can be touched.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, rng: np.random.Generator, step: float):
        self._mesh, self._step = mesh, step
        self._reachability = Reachability(mesh, sensor)
        self._grip, self.touching = Grip(rng, _PRESS, _MAX_TILT), False
        for _ in range(_TRIES):
            self._point = somewhere(mesh, self._reachability, _PRESS[0], rng)
            (normal,) = mesh.smooth_normals(self._point[None])
            self._frame = se3.frame_from_normal(normal[None], rng.uniform(0, 2 * np.pi, 1))[0]
            self.pose = se3.make(self._frame, self._point + _BEFORE * self._frame[:, 2])
            # the way to the start must be free: an arm cannot enter a bore from the side
            came_from = self.pose @ se3.translation(_COMING)
            if self._reachability.free(self._straight(self.pose, came_from, _IN_AIR)).all():
                return
        raise InputError(f"{mesh.name}: there is no room for a finger over any position that was tried")

    @property
    def depth(self) -> float:
        """Depth [m] by which the finger is pressed on, 0 in the air."""
        return self._grip.depth if self.touching else 0.0

    def touch(self, distance: float, direction: np.ndarray) -> Motion:
        """Move in a direction (3,) of the gel frame to the surface, over at most `distance` m, then flat onto it.

        It stays in the air if it meets no surface, or the gel does not fit there. A no-op if it touches already.
        """
        if self.touching:
            return True
        goal = self.pose @ se3.translation(distance * direction / np.linalg.norm(direction))
        way = self._straight(self.pose, goal, 1)
        met = np.flatnonzero(~self._reachability.free(way))
        # it may first meet a rim on which it does not fit, and still find a place further on
        downs = (self._down_below(at) for at in way[met[0] :]) if len(met) else iter(())
        air = way[: met[0]] if len(met) else way
        poses = next((down for down in downs if down is not None), air[_IN_AIR - 1 :: _IN_AIR])
        for self.pose in poses:
            yield self.pose
        return self.touching

    def slide(self, heading: float, length: float) -> Motion:
        """Slide straight for `length` m, or as far as it can; a no-op if it does not touch.

        heading [rad]: in the gel's plane, from its x axis to its y axis.
        """
        direction, gone = self._frame @ (np.cos(heading), np.sin(heading), 0.0), 0.0
        if not self.touching:
            return False
        while gone < length - self._step / 2:
            self._grip.shake()
            ahead = straight_on(self._mesh, self._point, direction, self._step)
            frame = carried(self._frame, ahead.normal)
            pose, reachable = self._pressed(ahead.point, frame)
            if not reachable or ahead.moved < MIN_PROGRESS * self._step:
                return False
            self._point, self._frame, self.pose = ahead.point, frame, pose
            direction, gone = ahead.heading, gone + ahead.moved
            yield self.pose
        return True

    def lift(self, height: float) -> Motion:
        """Lift straight off the surface by `height` m, or up to an obstacle."""
        above = self.pose @ se3.translation([0.0, 0.0, height])
        return (yield from self._off(self._straight(self.pose, above, _LIFTING)))

    def approach(self, goal: np.ndarray) -> Motion:
        """Move through the air to a pose T_obj_gel (4, 4), straight and turning, or up to an obstacle.

        A no-op if it touches.
        """
        if self.touching:
            return False
        return (yield from self._off(self._straight(self.pose, goal, _IN_AIR)))

    def stay_in_place(self, moved: np.ndarray) -> np.ndarray:
        """Return its pose after the object was moved below it, by `moved` T_old_new (4, 4) of the object's frame.

        The finger yields along its axis, so that it keeps touching if it can.
        """
        self.pose = se3.inverse(moved) @ self.pose
        if self.touching:
            (self._point,), _, _ = self._mesh.closest_points(self.pose[None, :3, 3])
            self._frame = carried(self.pose[:3, :3], self._mesh.smooth_normals(self._point[None])[0])
            pose, self.touching = self._pressed(self._point, self._frame)
            self.pose = pose if self.touching else self.pose
        return self.pose

    def _off(self, way: np.ndarray) -> Motion:
        """Move along a way (N, 4, 4) until it would penetrate deeper than before."""
        deepest = self._reachability.deepest(np.concatenate([self.pose[None], way]))
        met = np.flatnonzero(deepest[1:] > np.minimum.accumulate(deepest)[:-1] + _GRAZES)
        way = way[: met[0]] if len(met) else way
        self.touching = self.touching and not len(way)
        for self.pose in way:
            yield self.pose
        return not len(met)

    def _down_below(self, at: np.ndarray) -> np.ndarray | None:
        """Return poses (N, 4, 4) down to the surface point nearest to a pose (4, 4), flat from the lowest free
        clearance; None if the gel does not fit there, or an obstacle blocks every way."""
        (point,), _, _ = self._mesh.closest_points(at[None, :3, 3])
        frame = carried(at[:3, :3], self._mesh.smooth_normals(point[None])[0])
        goal, reachable = self._pressed(point, frame)
        for clearance in _CLEARANCES if reachable else ():
            above = goal @ se3.translation([0.0, 0.0, clearance])
            over, descent = self._straight(self.pose, above, _IN_AIR), self._straight(above, goal, 1)
            # only the first half must be free: the last part of the descent is contact
            if self._reachability.free(np.concatenate([over, descent[: len(descent) // 2]])).all():
                self._point, self._frame, self.touching = point, frame, True
                return np.concatenate([over, descent])
        return None

    def _pressed(self, point: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, bool]:
        return pressed_pose(self._reachability, point, frame, self._grip.tilt, self._grip.depth)

    def _straight(self, start: np.ndarray, goal: np.ndarray, pace: int) -> np.ndarray:
        """Return poses (N, 4, 4) from `start` (left out) to a goal (4, 4), which is the last, `pace` steps apart."""
        count = max(int(np.ceil(np.linalg.norm(goal[:3, 3] - start[:3, 3]) / (pace * self._step))), 1)
        fractions = (np.arange(count) + 1) / count
        turn = np.zeros(6)
        turn[3:] = se3.log(se3.inverse(start) @ goal)[3:]
        turned = start[:3, :3] @ se3.exp(fractions[:, None] * turn)[:, :3, :3]
        return se3.make(turned, start[:3, 3] + fractions[:, None] * (goal[:3, 3] - start[:3, 3]))
