"""One step of a gel over a surface: straight on, as it is held there, if it can be (paper section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from ..rendering.contact_poses import Reachability, pose_from_contact

MIN_PROGRESS = 0.3
"""Of a step. A fold or rim can make the closest point fall back to where the sensor already is."""
_TRIES = 64


@dataclass(frozen=True)
class Ahead:
    """Where a step ends: point (3,) m on the surface, its normal (3,), heading (3,) unit from there on, and how far the
    two points lie apart, `moved` m."""

    point: np.ndarray
    normal: np.ndarray
    heading: np.ndarray
    moved: float


def straight_on(mesh: ObjectMesh, point: np.ndarray, heading: np.ndarray, step: float) -> Ahead:
    """A step of about `step` m from a point (3,) of the surface in direction `heading` (3,), on a straightest geodesic.

    The heading there has no length where the step leads nowhere.
    """
    (ahead,), _, _ = mesh.closest_points((point + step * heading)[None])
    (normal,) = mesh.smooth_normals(ahead[None])
    moved = ahead - point
    tangent = moved - (moved @ normal) * normal
    return Ahead(ahead, normal, tangent / max(np.linalg.norm(tangent), 1e-12), float(np.linalg.norm(moved)))


def place(
    reachability: Reachability, point: np.ndarray, normal: np.ndarray, yaw: float, tilt: np.ndarray, depth: float
) -> tuple[np.ndarray, bool]:
    """Gel pose T_obj_gel (4, 4) that presses `depth` m at a point (3,), turned by yaw, tilted by `tilt` (2,) rad about
    its x and y axes; and whether it can be reached and touches."""
    angle, azimuth = np.linalg.norm(tilt), np.arctan2(tilt[1], tilt[0])
    as_array = [np.array([value]) for value in (yaw, angle, azimuth, depth)]
    poses, reachable = reachability.settle(pose_from_contact(point[None], normal[None], *as_array), as_array[3])
    return poses[0], bool(reachable[0])


def somewhere(mesh: ObjectMesh, reachability: Reachability, depth: float, rng: np.random.Generator) -> np.ndarray:
    """A place (3,) that can be touched. Raises InputError if none is found."""
    for _ in range(_TRIES):
        (start,), _, _ = mesh.sample_surface(1, rng)
        (normal,) = mesh.smooth_normals(start[None])
        if place(reachability, start, normal, 0.0, np.zeros(2), depth)[1]:
            return start
    raise InputError(f"{mesh.name}: no reachable place to start a slide; is the mesh closed and in metres?")


def random_tangent(normal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A unit direction (3,) at right angles to the normal (3,)."""
    direction = rng.standard_normal(3)
    direction -= (direction @ normal) * normal
    return direction / np.linalg.norm(direction)


class Grip:
    """How a gel is pressed on, by a hand that is not quite steady: depth [m] within `press`, tilt (2,) rad to
    `max_tilt`."""

    def __init__(self, rng: np.random.Generator, press: tuple[float, float], max_tilt: float):
        self._rng, self._press, self._max_tilt = rng, press, max_tilt
        self.depth, self.tilt = rng.uniform(*press), np.zeros(2)

    def shake(self) -> None:
        """Both one step on, at random."""
        low, high = self._press
        self.depth = _reflect(self.depth + self._rng.uniform(-1, 1) * (high - low) / 10, low, high)
        tilt = 0.97 * self.tilt + self._rng.normal(0, 0.08 * self._max_tilt, 2)
        self.tilt = tilt * min(1.0, self._max_tilt / max(np.linalg.norm(tilt), 1e-12))


def _reflect(value: float, low: float, high: float) -> float:
    return low + abs(value - low) if value < high else high - (value - high)
