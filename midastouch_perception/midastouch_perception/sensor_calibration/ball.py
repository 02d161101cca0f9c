"""A ball against the gel: where it touches and how steep it is there, in closed form."""

from __future__ import annotations

import numpy as np

from ..sensor_model import SensorModel

_SIDES = np.array([-1.0, 1.0])


def ball_penetration(centre: np.ndarray, radius: float, sensor: SensorModel) -> np.ndarray:
    """Penetration (H, W) float32 m of a ball into the undeformed gel, negative (down to -inf) where it does not reach.

    centre (3,) m, gel frame; radius m. As `PenetrationRenderer` renders it, along the camera's rays.
    """
    tangent_x, tangent_y = sensor.rays
    start = np.array([0, 0, sensor.gel_distance]) - np.asarray(centre, float)  # of every ray, from the ball's centre
    square = tangent_x**2 + tangent_y**2 + 1
    along = tangent_x * start[0] + tangent_y * start[1] - start[2]
    discriminant = along**2 - square * (start @ start - radius**2)
    depth = (-along - np.sqrt(np.maximum(discriminant, 0))) / square
    return np.where(discriminant > 0, sensor.gel_depth - depth, -np.inf).astype(np.float32)


def ball_centre(u: float, v: float, contact_radius: float, radius: float, sensor: SensorModel) -> np.ndarray:
    """Centre (3,) m, gel frame, of a ball that touches the gel in a circle of `contact_radius` m about pixel (u, v).

    u, v: column and row, pixel centres at whole numbers; the pixel may lie outside the image.
    """
    tangent_x = (u + 0.5 - sensor.width / 2) / sensor.focal
    tangent_y = -(v + 0.5 - sensor.height / 2) / sensor.focal
    depth = sensor.gel_distance
    for _ in range(20):
        depth = sensor.gel_distance - float(sensor.sag(depth * tangent_x, depth * tangent_y))
    x, y = depth * tangent_x, depth * tangent_y
    step = 2e-4
    (left, right), (below, above) = sensor.sag(x + step * _SIDES, y), sensor.sag(x, y + step * _SIDES)
    here = float(sensor.sag(x, y))
    slopes = np.array([right - left, above - below]) / (2 * step)
    bends = np.array([left + right - 2 * here, below + above - 2 * here]) / step**2 / (1 + slopes**2) ** 1.5
    outward = np.array([*slopes, -1.0]) / np.sqrt(1 + slopes @ slopes)
    # the gel curves away from the ball: the plane of the circle lies above the surface at its middle
    plane = 0.5 * contact_radius**2 * bends.mean()
    return np.array([x, y, sensor.gel_distance - depth]) + outward * (np.sqrt(radius**2 - contact_radius**2) - plane)
