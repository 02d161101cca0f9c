"""Forces between a gel and an object: an elastic layer that resists depth, and a bristle that sticks until it slips.

The layer is a mattress: pressure is stiffness times penetration, along the gel's axis (K. L. Johnson, Contact
Mechanics, sec. 4.3), as far as a gel gives way: of a higher wall at its border, only that part presses. The bristle is
the layer's shear: it holds up to friction times the normal force (Dahl 1968).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_motion.control.wrench import GEL_STIFFNESS
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import MAX_PENETRATION, SensorModel

_PIXELS = 0.25  # fraction of the image's resolution: 0.3 mm on a DIGIT
_FREE = 2e-5  # m: an object no deeper than this is out of the gel
_RING = 1e-4  # m
_WAYS = np.array(
    [[0.0, 0.0, 1.0]]
    + [
        [math.cos(up) * math.cos(around), math.cos(up) * math.sin(around), math.sin(up)]
        for up in np.radians((0.0, 30.0, 60.0))
        for around in np.radians(np.arange(0.0, 360.0, 30.0))
    ]
)  # in which a gel is drawn away from an object


@dataclass(frozen=True)
class Gel:
    """Properties of a gel: stiffness, as `GEL_STIFFNESS`; shear [N/m]; friction coefficient. Raises InputError for a
    value that is negative or not finite."""

    stiffness: float = GEL_STIFFNESS
    shear: float = 5e3
    friction: float = 0.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"gel: {name} is {value:g}; it must be a number that is not negative")


class GelLayer:
    """A gel on an object. Args: mesh; sensor, whose gel it is; gel.

    Attribute: deepest [m], largest depth at the last force.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, gel: Gel):
        self._renderer = PenetrationRenderer(mesh, sensor.scaled(_PIXELS))
        small, self._gel = self._renderer.sensor, gel
        x, y = (tangent * small.gel_depth for tangent in small.rays)
        self._where = np.stack([x, y, small.gel_distance - small.gel_depth], axis=-1).reshape(-1, 3)
        self._area = small.pixel_area
        self._sheared: np.ndarray = np.zeros(2)
        self.deepest = 0.0

    def indented(self, pose: np.ndarray, least: float) -> float:
        """Return the shortest way [m], of at least `least`, on which the gel gets off the object, rounded up to 0.1 mm.

        For a face it is its depth, for a wall at the gel's border the part of the gel that is behind it. pose: as for
        `force`.
        """
        deepest = float(self._renderer.render(pose[None])[0].max())
        while least < deepest:
            shifts = se3.make(np.tile(np.eye(3), (len(_WAYS), 1, 1)), least * _WAYS)
            if self._renderer.render(pose @ shifts).max(axis=(1, 2)).min() <= _FREE:
                break
            least += _RING
        return least

    def force(self, pose: np.ndarray, velocity: np.ndarray, period: float) -> np.ndarray:
        """Return force [N] and torque [N m] about the apex (6,) on the gel, in its frame, after `period` s more.

        pose: of the gel on the object, T_obj_gel (4, 4); velocity (2,) m/s of the apex over the surface, along the gel.
        """
        depth = np.maximum(self._renderer.render(pose[None])[0].ravel(), 0.0)
        self.deepest = float(depth.max())
        if self.deepest == 0.0:
            self._sheared = np.zeros(2)
            return np.zeros(6)
        pressed = self._gel.stiffness * self._area * np.minimum(depth, MAX_PENETRATION)
        normal = float(pressed.sum())
        centre = pressed @ self._where / normal
        self._sheared = self._sheared + period * velocity
        most = self._gel.friction * normal / self._gel.shear
        self._sheared *= min(1.0, most / max(float(np.linalg.norm(self._sheared)), 1e-12))
        force = np.array([*(-self._gel.shear * self._sheared), normal])
        return np.concatenate([force, np.cross(centre, force)])
