"""Conversion between penetration maps and clouds, one point per touched pixel, gel frame; exact for maps in steps."""

from __future__ import annotations

import numpy as np

from midastouch_common.errors import InputError

from .contact import in_steps
from .sensor_model import SensorModel

_OFF_PIXELS = 0.05  # px that a point may lie off its pixel; rounding causes a thousandth of that


def cloud_from_penetration(penetration: np.ndarray, mask: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Convert a penetration map to contact points.

    Parameters
    ----------
    penetration : (H, W) [m]
    mask : (H, W) bool
        Pixels to convert.
    sensor
        At the map's resolution.

    Returns
    -------
    (K, 3) float32 [m], gel frame
    """
    tangent_x, tangent_y = sensor.rays
    depth = (sensor.gel_depth - penetration)[mask]
    points = np.stack([tangent_x[mask] * depth, tangent_y[mask] * depth, sensor.gel_distance - depth], axis=1)
    return points.astype(np.float32)


def penetration_from_cloud(points: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Convert a contact cloud back to a penetration map: undo `cloud_from_penetration`.

    Parameters
    ----------
    points
        Contact points (K, 3) [m] in the gel frame; those outside the image are dropped.
    sensor
        Sensor model at map resolution.

    Returns
    -------
    (H, W) float32
        Penetration [m], in steps of 1 um.

    Raises
    ------
    InputError
        Other shape, points that are not finite, or that do not lie at pixels of this sensor.
    """
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"contact cloud: shape {points.shape}, need (K, 3)")
    if not np.isfinite(points).all():
        raise InputError("contact cloud: non-finite points; publish contact points only")
    penetration = np.zeros((sensor.height, sensor.width), np.float32)
    depth = sensor.gel_distance - points[:, 2]
    ahead = depth > 1e-6
    depth = np.where(ahead, depth, 1.0)
    at = np.stack([points[:, 0], -points[:, 1]]) / depth * sensor.focal
    at += np.array([[sensor.width], [sensor.height]]) / 2 - 0.5
    u, v = np.rint(at).astype(int)
    inside = ahead & (u >= 0) & (u < sensor.width) & (v >= 0) & (v < sensor.height)
    at, u, v = at[:, inside], u[inside], v[inside]
    if np.abs(at - (u, v)).max(initial=0.0) > _OFF_PIXELS:
        raise InputError(
            f"contact cloud: its points are not at pixels of {sensor.name}; start tdn, tcn and particle_filter with "
            "the same sensor_model"
        )
    penetration[v, u] = np.maximum(sensor.gel_depth[v, u] - depth[inside], 0)
    return in_steps(penetration)
