"""What an image measures of a contact: its depth, the slope of the touched surface, and where and how large it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from midastouch_perception.sensor_model import SensorModel

_STEP = 1e-5  # m, over which the gel's slope is taken
_TELLING = 2e-3  # m: a contact that extends less is weak evidence of the surface's slope
_STEEPEST = 0.5  # steepest slope of a surface that is believed


class Measured(NamedTuple):
    """Contact in one image: stamp [s]; depth [m] of the gel's deepest point, 0 if nothing touches; slope (2,) of the
    touched surface, dz/dx and dz/dy in the gel's frame; centre (2,) [m] of the contact there; area [m^2], and mean, the
    mean depth [m] in it."""

    stamp: float
    depth: float
    slope: np.ndarray
    centre: np.ndarray
    area: float = 0.0
    mean: float = 0.0

    @classmethod
    def of(cls, stamp: float, depth: float, area: float, points: np.ndarray, sensor: SensorModel) -> Measured:
        """Return the contact in an image.

        Parameters
        ----------
        stamp : [s]
        depth : [m]
            0 without a contact.
        area : [m^2]
        points : (K, 3) [m]
            Of the contact, in the gel's frame.
        sensor
        """
        if depth <= 0:
            return cls(stamp, 0.0, np.zeros(2), np.zeros(2))
        # points show the shape within the contact's outline, by which soft gel has sunk in
        shape = points[:, 2] - sensor.sag(points[:, 0], points[:, 1])
        mean = depth - float(shape.max(initial=0.0) - shape.mean()) if len(points) else depth
        return cls(stamp, depth, slope_of(points, sensor), centre_of(points), area, mean)


def centre_of(points: np.ndarray) -> np.ndarray:
    """Return the centre (2,) [m] of contact points (K, 3) [m] in the gel's frame; the apex without any."""
    return points[:, :2].mean(axis=0) if len(points) else np.zeros(2)


def slope_of(points: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Fit a plane to contact points.

    It is a least-squares fit with a prior that weighs as much as a contact that extends 2 mm: the slope of the
    untouched gel there, on which the object lies. On a round object the contact is small, so the prior dominates and
    the gel turns until the contact lies at its apex.

    Parameters
    ----------
    points : (K, 3) in the gel's frame [m]
    sensor

    Returns
    -------
    (2,) slopes dz/dx and dz/dy
    """
    if len(points) < 3:
        return np.zeros(2)
    centre = centre_of(points)
    gel = np.array([sensor.sag(*(centre + each)) - sensor.sag(*(centre - each)) for each in _STEP * np.eye(2)])
    gel /= 2 * _STEP
    across = points[:, :2] - centre
    normal = across.T @ across + len(points) * _TELLING**2 * np.eye(2)
    beside = np.linalg.solve(normal, across.T @ (points[:, 2] - across @ gel))
    return np.clip(gel + beside, -_STEEPEST, _STEEPEST)
