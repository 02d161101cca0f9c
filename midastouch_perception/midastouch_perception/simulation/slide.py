"""Sliding trajectories: locally straight walks over the surface with smooth press, tilt and yaw (paper section 5)."""

from __future__ import annotations

import numpy as np

from .. import se3
from ..errors import InputError
from ..mesh import ObjectMesh
from ..sensor_model import SensorModel
from .contact_poses import Reachability, pose_from_contact

_TRIES = 64


def simulate_slide(
    mesh: ObjectMesh,
    sensor: SensorModel,
    length: float,
    rng: np.random.Generator,
    step: float = 1.5e-3,
    press: tuple[float, float] = (0.5e-3, 1e-3),
    max_tilt: float = np.radians(5.0),
) -> np.ndarray:
    """Gel poses T_obj_gel (N, 4, 4) of one slide of `length` m in steps of `step` m.

    The sensor follows straightest geodesics; after a quarter of the object's diagonal, or where it cannot go on, it
    takes a new heading. Yaw drifts 1 deg a step and changes sense with the heading; press [m] and tilt [rad] walk
    within their bounds. Raises InputError if no reachable path is found (object smaller than a few steps).
    """
    reachability = Reachability(mesh, sensor)
    n = max(round(length / step), 1)
    position = None
    for _ in range(_TRIES):
        start, _, _ = mesh.sample_surface(1, rng)
        normal = mesh.smooth_normals(start)
        if _place(reachability, start, normal, 0.0, np.zeros(2), press[0])[1]:
            position = start[0]
            break
    if position is None:
        raise InputError(f"{mesh.name}: no reachable place to start a slide; is the mesh closed and in metres?")

    poses = []
    depth, tilt, yaw = rng.uniform(*press), np.zeros(2), rng.uniform(0, 2 * np.pi)
    heading, turn, left = np.zeros(3), 1.0, 0.0
    while len(poses) < n:
        depth = _reflect(depth + rng.uniform(-1, 1) * (press[1] - press[0]) / 10, *press)
        tilt = 0.97 * tilt + rng.normal(0, 0.08 * max_tilt, 2)
        tilt *= min(1.0, max_tilt / max(np.linalg.norm(tilt), 1e-12))
        for _ in range(_TRIES):
            if left <= 0 or not heading.any():
                heading = _random_tangent(mesh.smooth_normals(position[None])[0], rng)
                turn, left = rng.choice([-1.0, 1.0]), 0.25 * mesh.diagonal * rng.uniform(0.4, 1)
            ahead, _, _ = mesh.closest_points((position + step * heading)[None])
            normal = mesh.smooth_normals(ahead)
            moved = ahead[0] - position
            pose, reachable = _place(reachability, ahead, normal, yaw + turn * np.radians(1), tilt, depth)
            # a fold or rim can make the closest point fall back to where the sensor already is
            if reachable and np.linalg.norm(moved) > 0.3 * step:
                break
            left = 0.0
        else:
            raise InputError(f"{mesh.name}: the slide got stuck after {len(poses)} frames; try another seed")
        yaw += turn * np.radians(1)
        left -= np.linalg.norm(moved)
        heading = moved - (moved @ normal[0]) * normal[0]
        heading /= max(np.linalg.norm(heading), 1e-12)
        position = ahead[0]
        poses.append(pose)
    return np.stack(poses)


def measure_poses(
    poses: np.ndarray, rng: np.random.Generator, sigma_t: float = 5e-4, sigma_r: float = np.radians(1.0)
) -> np.ndarray:
    """Poses as a noisy tracker sees them: independent N(0, sigma_t m), N(0, sigma_r rad) per axis (paper section 5)."""
    noise = rng.standard_normal((len(poses), 6)) * np.repeat([sigma_t, sigma_r], 3)
    return poses @ se3.exp(noise)


def _place(reachability, point, normal, yaw, tilt, depth):
    angle, azimuth = np.linalg.norm(tilt), np.arctan2(tilt[1], tilt[0])
    as_array = [np.array([value]) for value in (yaw, angle, azimuth, depth)]
    poses, reachable = reachability.settle(pose_from_contact(point, normal, *as_array), as_array[3])
    return poses[0], bool(reachable[0])


def _random_tangent(normal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    direction = rng.standard_normal(3)
    direction -= (direction @ normal) * normal
    return direction / np.linalg.norm(direction)


def _reflect(value: float, low: float, high: float) -> float:
    return low + abs(value - low) if value < high else high - (value - high)
