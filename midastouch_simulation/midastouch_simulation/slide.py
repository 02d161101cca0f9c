"""Sliding trajectories: locally straight walks over a surface with smooth press, tilt and yaw (paper section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.surface_walk import MIN_PROGRESS, Ahead, carried, straight_on
from midastouch_perception.mesh_report import exposure
from midastouch_perception.rendering.contact_poses import Reachability
from midastouch_perception.sensor_model import SensorModel

STEP = 1.5e-3
"""Distance [m] between two images of a simulated slide."""
_PRESS = 0.5e-3, 1e-3  # m
_MAX_TILT = np.radians(5.0)
_MOST_TURN = np.radians(10.0)  # between two images: 200 deg/s at 20 images a second
_DRIFT = np.radians([0, 0, 0, 0, 0, 1.0])  # of yaw, per step
_TRIES = 64
_AROUND = 20_000  # surface points among which a leap looks for its goal
_GOALS = 200  # number of these that are tried
_YAWS = 72


def pressed_pose(
    reachability: Reachability, point: np.ndarray, frame: np.ndarray, tilt: np.ndarray, depth: float
) -> tuple[np.ndarray, bool]:
    """Return the gel pose T_obj_gel (4, 4) that presses `depth` m at a point (3,), its axes `frame` (3, 3) tilted by
    `tilt` (2,) rad about x and y, and whether it can be reached and touches."""
    tilted = frame @ se3.exp(np.concatenate([np.zeros(3), tilt, np.zeros(1)]))[:3, :3]
    pose = se3.make(tilted, point - depth * tilted[:, 2])
    poses, reachable = reachability.settle(pose[None], np.array([depth]))
    return poses[0], bool(reachable[0])


def somewhere(mesh: ObjectMesh, reachability: Reachability, depth: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a surface point (3,) that can be touched from outside. Raises InputError if none is found."""
    for _ in range(_TRIES):
        (start,), _, _ = mesh.sample_surface(1, rng)
        (normal,) = mesh.smooth_normals(start[None])
        touches = pressed_pose(reachability, start, _turned(normal, 0.0), np.zeros(2), depth)[1]
        if touches and exposure(mesh, start[None], normal[None])[0] > 0:
            return start
    raise InputError(f"{mesh.name}: no reachable point to start a slide; is the mesh closed and in metres?")


def random_tangent(normal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw a unit direction (3,) at right angles to the normal (3,)."""
    direction = rng.standard_normal(3)
    direction -= (direction @ normal) * normal
    return direction / np.linalg.norm(direction)


class Grip:
    """Press of a gel by a hand that is not quite steady: depth [m] in the range `press`, tilt (2,) rad up to
    `max_tilt`."""

    def __init__(self, rng: np.random.Generator, press: tuple[float, float], max_tilt: float):
        self._rng, self._press, self._max_tilt, self.depth = rng, press, max_tilt, rng.uniform(*press)
        self.tilt: np.ndarray = np.zeros(2)

    def shake(self) -> None:
        """Change depth and tilt by one random step."""
        low, high = self._press
        depth = self.depth + self._rng.uniform(-1, 1) * (high - low) / 10
        self.depth = low + abs(depth - low) if depth < high else high - (depth - high)  # it bounces off both ends
        tilt = 0.97 * self.tilt + self._rng.normal(0, 0.08 * self._max_tilt, 2)
        self.tilt = tilt * min(1.0, self._max_tilt / max(float(np.linalg.norm(tilt)), 1e-12))


@dataclass(frozen=True)
class Leap:
    """Jump within a slide, as over a rim or after a lift.

    distance [m] between the positions; angle [rad] of the whole turn, any if None. The jump comes after a third of the
    slide.
    """

    distance: float
    angle: float | None = None

    @staticmethod
    def at(frames: int) -> int:
        """Return the index of the first pose after it in a slide of `frames` poses."""
        return frames // 3


def simulate_slide(
    mesh: ObjectMesh,
    sensor: SensorModel,
    length: float,
    rng: np.random.Generator,
    step: float = STEP,
    leap: Leap | None = None,
) -> np.ndarray:
    """Simulate one slide.

    The sensor follows straightest geodesics; after at most a quarter of the object's diagonal, or if it is blocked, it
    takes a new heading. As at the end of an arm, it pivots on a rim: its normal turns by at most 10 deg per step. Yaw
    drifts 1 deg per step and changes sense with the heading; press [m] and tilt [rad] walk within their bounds.

    Parameters
    ----------
    mesh, sensor
    length : [m]
    rng
    step : [m]
    leap
        Replaces one step, if given.

    Returns
    -------
    `T_obj_gel` (N, 4, 4)

    Raises
    ------
    InputError
        No reachable path is found, as on an object smaller than a few steps.
    """
    n = max(round(length / step), 1)
    walk = _Walk(mesh, sensor, rng, step)
    poses: list[np.ndarray] = []
    while len(poses) < n:
        if leap is not None and poses and len(poses) == leap.at(n):
            poses.append(walk.leap(leap, poses[-1]))
        else:
            poses.append(walk.advance())
    return np.stack(poses)


class _Walk:
    """Walk of the sensor over a surface."""

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, rng: np.random.Generator, step: float):
        self._mesh, self._rng, self._step = mesh, rng, step
        self._reachability = Reachability(mesh, sensor)
        self._position = somewhere(mesh, self._reachability, _PRESS[0], rng)
        self._grip = Grip(rng, _PRESS, _MAX_TILT)
        # the gel's axes (3, 3) before it is tilted
        self._frame = _turned(mesh.smooth_normals(self._position[None])[0], rng.uniform(0, 2 * np.pi))
        self._heading, self._turn, self._left = np.zeros(3), 1.0, 0.0
        self._frames = 0

    def advance(self) -> np.ndarray:
        """Take one step; return the new pose (4, 4)."""
        rng, mesh, grip = self._rng, self._mesh, self._grip
        grip.shake()
        for _ in range(_TRIES):
            if self._left <= 0 or not self._heading.any():
                self._heading = random_tangent(mesh.smooth_normals(self._position[None])[0], rng)
                self._turn, self._left = rng.choice([-1.0, 1.0]), 0.25 * mesh.diagonal * rng.uniform(0.4, 1)
            ahead = self._as_far_as_it_turns(straight_on(mesh, self._position, self._heading, self._step))
            frame = carried(self._frame, ahead.normal) @ se3.exp(self._turn * _DRIFT)[:3, :3]
            pose, reachable = pressed_pose(self._reachability, ahead.point, frame, grip.tilt, grip.depth)
            if reachable and ahead.moved > MIN_PROGRESS * self._step:
                break
            self._left = 0.0
        else:
            raise InputError(f"{mesh.name}: the slide got stuck after {self._frames} frames; try another seed")
        self._left -= ahead.moved
        self._heading, self._position, self._frame = ahead.heading, ahead.point, frame
        self._frames += 1
        return pose

    def _as_far_as_it_turns(self, ahead: Ahead) -> Ahead:
        """Return a step, or the part of a step over a rim that the gel can turn between two images."""
        turn = np.arccos(np.clip(self._frame[:, 2] @ ahead.normal, -1, 1))
        if turn <= _MOST_TURN:
            return ahead
        normal = carried(self._frame, ahead.normal, _MOST_TURN)[:, 2]
        tangent = self._heading - (self._heading @ normal) * normal
        point = self._position + _MOST_TURN / turn * (ahead.point - self._position)
        return Ahead(point, normal, tangent / max(np.linalg.norm(tangent), 1e-12), ahead.moved)

    def leap(self, leap: Leap, last: np.ndarray) -> np.ndarray:
        """Jump to a pose (4, 4) at the leap's distance from the last position and return it; with an angle, to where
        the surface faces most away from the `last` pose (4, 4), as behind a rim."""
        goals, normals = self._goals(leap.distance)
        order = self._rng.permutation(len(goals))
        yaws = self._rng.uniform(0, 2 * np.pi, len(goals))
        if leap.angle is not None:
            order = np.argsort(normals @ last[:3, 2], kind="stable")
            yaws = _yaws(normals, last[:3, :3], leap.angle)
        for k in order:
            frame = _turned(normals[k], yaws[k])
            pose, reachable = pressed_pose(self._reachability, goals[k], frame, np.zeros(2), self._grip.depth)
            if reachable and exposure(self._mesh, goals[k : k + 1], normals[k : k + 1])[0] > 0:
                self._position, self._frame, self._left = goals[k], frame, 0.0
                self._grip.tilt = np.zeros(2)
                self._frames += 1
                return pose
        raise InputError(f"{self._mesh.name}: no reachable pose {1e3 * leap.distance:.0f} mm away; try another seed")

    def _goals(self, distance: float) -> tuple[np.ndarray, np.ndarray]:
        """Return surface points (N, 3) whose distances are nearest to `distance`, and their normals (N, 3)."""
        points, _, _ = self._mesh.sample_surface(_AROUND, self._rng)
        off = np.abs(np.linalg.norm(points - self._position, axis=1) - distance)
        points = points[np.argsort(off, kind="stable")[:_GOALS]]
        return points, self._mesh.smooth_normals(points)


def _turned(normal: np.ndarray, yaw: float) -> np.ndarray:
    return se3.frame_from_normal(normal[None], np.array([yaw]))[0]


def _yaws(normals: np.ndarray, last: np.ndarray, angle: float) -> np.ndarray:
    """Return yaws (N,) that turn poses with these normals (N, 3) by `angle` against the rotation `last` (3, 3)."""
    yaws = np.arange(_YAWS) * 2 * np.pi / _YAWS
    every = se3.frame_from_normal(np.repeat(normals, _YAWS, axis=0), np.tile(yaws, len(normals)))
    off = np.abs(se3.rotation_angle(last.T @ every) - angle).reshape(len(normals), _YAWS)
    return yaws[np.argmin(off, axis=1)]


def measure_poses(
    poses: np.ndarray, rng: np.random.Generator, sigma_t: float = 5e-4, sigma_r: float = np.radians(1.0)
) -> np.ndarray:
    """Return poses as a noisy tracker measures them: N(0, sigma_t m), N(0, sigma_r rad) per axis (paper section 5)."""
    noise = rng.standard_normal((len(poses), 6)) * np.repeat([sigma_t, sigma_r], 3)
    return poses @ se3.exp(noise)
