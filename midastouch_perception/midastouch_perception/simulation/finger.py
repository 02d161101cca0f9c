"""A finger that an arm moves over an object: it touches, slides, lifts and touches elsewhere."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from ..rendering.contact_poses import Reachability
from ..sensor_model import SensorModel
from .slide import MIN_PROGRESS, Ahead, Grip, carried, pressed_pose, somewhere, straight_on

_PRESS, _MAX_TILT = (0.5e-3, 1e-3), np.radians(5.0)  # of simulated slides
_IN_AIR = 4  # times as fast as on the surface
_CLEARANCES = (8e-3, 24e-3, 72e-3)  # m over the surface; the higher ones where something is in the way
_AROUND = 0.04  # m: so far beyond a goal that cannot be touched another is looked for
_TRIES = 64


class SimulatedFinger:
    """Over a random position at first. Its motions yield its poses T_obj_gel (4, 4), one per image.

    Two poses are `step` m apart on the surface, four times as far in the air. The gel keeps its direction in the
    surface, as at the end of an arm that does not twist.

    Attributes: pose T_obj_gel (4, 4), the newest; touching, whether it is pressed on.
    Raises InputError if nothing of the object can be touched.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, rng: np.random.Generator, step: float):
        self._mesh, self._step = mesh, step
        self._reachability = Reachability(mesh, sensor)
        self._grip, self.touching = Grip(rng, _PRESS, _MAX_TILT), False
        for _ in range(_TRIES):
            self._point = somewhere(mesh, self._reachability, _PRESS[0], rng)
            (normal,) = mesh.smooth_normals(self._point[None])
            self._frame = se3.frame_from_normal(normal[None], rng.uniform(0, 2 * np.pi, 1))[0]
            self.pose = _over(self._point, self._frame, _CLEARANCES[0])
            if self._reachability.free(self.pose[None])[0]:
                return
        raise InputError(f"{mesh.name}: there is no room for a finger over any position that was tried")

    def slide(self, heading: float, length: float) -> Iterator[np.ndarray]:
        """Straight on for `length` m, or as far as it can; heading [rad] in the gel's plane, from its x axis to its y.

        Nothing if it does not touch.
        """
        direction, gone = self._direction(heading), 0.0
        while self.touching and gone < length - self._step / 2:
            ahead = self._step_on(direction, self._step)
            if ahead is None:
                return
            direction, gone = ahead.heading, gone + ahead.moved
            yield self.pose

    def slide_to(self, goal: np.ndarray) -> Iterator[np.ndarray]:
        """Along the surface to a point (3,) of it, if each step comes nearer; else nothing, and it stays there."""
        before, way = (self._point, self._frame, self.pose), []
        while self.touching and not self.touches(goal):
            far = np.linalg.norm(goal - self._point)
            length = min(self._step, far)
            ahead = self._step_on(_towards(goal, self._point, self._frame), length)
            if ahead is None or np.linalg.norm(goal - self._point) > far - MIN_PROGRESS * length:
                self._point, self._frame, self.pose = before
                return
            way.append(self.pose)
        for self.pose in way:
            yield self.pose

    def leap(self, heading: float, length: float) -> Iterator[np.ndarray]:
        """Up, and down where the surface can be touched first, `length` m further along it or up to 40 mm more.

        heading [rad] as of a slide. Nothing if there is no such position, or no way to it through the air; from over
        the surface, with a length of 0, down onto it.
        """
        yield from self._down_on(self._places(self._point, self._frame, self._direction(heading), length))

    def leap_to(self, goal: np.ndarray) -> Iterator[np.ndarray]:
        """Lift, and touch at a point (3,) of the surface, or up to 40 mm before it if the point cannot be touched.

        Yields nothing if no such position can be touched, or no way through the air leads there.
        """
        (normal,) = self._mesh.smooth_normals(goal[None])
        frame = carried(self._frame, normal)
        yield from self._down_on(self._places(goal, frame, _towards(self._point, goal, frame), 0.0))

    def touches(self, goal: np.ndarray) -> bool:
        """Whether it is pressed on at a point (3,) of the surface, to half a step."""
        return self.touching and bool(np.linalg.norm(goal - self._point) <= self._step / 2)

    def stay_in_place(self, moved: np.ndarray) -> np.ndarray:
        """Its pose after the object has been moved below it, by `moved` T_old_new (4, 4) of the object's frame.

        The finger yields along its axis, so that it keeps touching where it can.
        """
        self.pose = se3.inverse(moved) @ self.pose
        (self._point,), _, _ = self._mesh.closest_points(self.pose[None, :3, 3])
        self._frame = carried(self.pose[:3, :3], self._mesh.smooth_normals(self._point[None])[0])
        if self.touching:
            pose, self.touching = self._pressed(self._point, self._frame)
            self.pose = pose if self.touching else self.pose
        return self.pose

    def _direction(self, heading: float) -> np.ndarray:
        return self._frame @ (np.cos(heading), np.sin(heading), 0.0)

    def _step_on(self, direction: np.ndarray, length: float) -> Ahead | None:
        """A step of `length` m in a direction (3,), if it leads on and the gel can be pressed on there."""
        self._grip.shake()
        ahead = straight_on(self._mesh, self._point, direction, length)
        frame = carried(self._frame, ahead.normal)
        pose, reachable = self._pressed(ahead.point, frame)
        if not reachable or ahead.moved < MIN_PROGRESS * length:
            return None
        self._point, self._frame, self.pose = ahead.point, frame, pose
        return ahead

    def _down_on(self, steps: Iterator[tuple[np.ndarray, np.ndarray]]) -> Iterator[np.ndarray]:
        """Through the air onto the first of these points (3,), with frames (3, 3), that can be touched."""
        for point, frame in steps:
            goal, reachable = self._pressed(point, frame)
            way = self._way_through_the_air(goal) if reachable else None
            if way is not None:
                self._point, self._frame, self.touching = point, frame, True
                for self.pose in way:
                    yield self.pose
                return

    def _places(
        self, point: np.ndarray, frame: np.ndarray, direction: np.ndarray, length: float
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Points (3,) and frames (3, 3) along the surface from a point on, the first of them `length` m away."""
        gone = 0.0
        while True:
            if gone >= length:
                yield point, frame
            ahead = straight_on(self._mesh, point, direction, _IN_AIR * self._step)
            gone += ahead.moved
            if ahead.moved < MIN_PROGRESS * self._step or gone > length + _AROUND:
                return
            point, direction, frame = ahead.point, ahead.heading, carried(frame, ahead.normal)

    def _way_through_the_air(self, goal: np.ndarray) -> np.ndarray | None:
        """Poses (N, 4, 4) to a pressed one, as low as nothing is in the way; None if there always is."""
        for clearance in _CLEARANCES:
            up, down = _raised(self.pose, clearance if self.touching else 0.0), _raised(goal, clearance)
            lift, over = self._straight(self.pose, up, 1), self._straight(up, down, _IN_AIR)
            descent = self._straight(down, goal, 1)
            # the last part of it is contact
            between = [lift[len(lift) // 2 :], over, descent[: len(descent) // 2]]
            if self._reachability.free(np.concatenate(between)).all():
                return np.concatenate([lift, over, descent])
        return None

    def _pressed(self, point: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, bool]:
        return pressed_pose(self._reachability, point, frame, self._grip.tilt, self._grip.depth)

    def _straight(self, start: np.ndarray, goal: np.ndarray, pace: int) -> np.ndarray:
        """Poses (N, 4, 4) after `start` up to a goal (4, 4), `pace` steps at a time."""
        count = int(np.ceil(np.linalg.norm(goal[:3, 3] - start[:3, 3]) / (pace * self._step)))
        fractions = (np.arange(count) + 1) / max(count, 1)
        return start @ se3.exp(fractions[:, None] * se3.log(se3.inverse(start) @ goal))


def _towards(goal: np.ndarray, point: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """The direction (3,) along the surface at a point (3,) to a goal (3,); of no length if that is straight below."""
    tangent = frame[:, :2] @ (frame[:, :2].T @ (goal - point))
    return tangent / max(np.linalg.norm(tangent), 1e-12)


def _over(point: np.ndarray, frame: np.ndarray, height: float) -> np.ndarray:
    return se3.make(frame, point + height * frame[:, 2])


def _raised(pose: np.ndarray, height: float) -> np.ndarray:
    return pose @ se3.make(np.eye(3), np.array([0.0, 0.0, height]))
