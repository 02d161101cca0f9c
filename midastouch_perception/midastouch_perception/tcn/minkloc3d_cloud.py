"""What MinkLoc3D sees of a contact: a point per touched pixel, scaled to the cube [-1, 1]."""

from __future__ import annotations

import cv2
import numpy as np

from ..pointcloud import cloud_from_penetration
from ..sensor_model import SensorModel


def contact_cloud(penetration: np.ndarray, sensor: SensorModel, points: int, rng: np.random.Generator) -> np.ndarray:
    """Contact points (K, 3) float32 m, K <= points, camera frame, of a penetration map (H, W) m.

    The map is brought to the resolution of `sensor`, the image's: the network was trained on a point per image pixel.
    Where there are more, each is kept with the same chance (the official code prefers lower rows).
    """
    size = sensor.width, sensor.height
    mask = cv2.resize((penetration > 0).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST).astype(bool)
    cloud = cloud_from_penetration(cv2.resize(penetration, size, interpolation=cv2.INTER_LINEAR), mask, sensor)
    cloud[:, 2] -= np.float32(sensor.gel_distance)
    return cloud if len(cloud) <= points else cloud[rng.choice(len(cloud), points, replace=False)]


def scaled_cloud(cloud: np.ndarray) -> np.ndarray:
    """A cloud (K, 3), K >= 1, moved and scaled so that its smallest coordinate is -1 and its largest 1.

    Over all axes together, as in the official code: what is lost by it (metric size, place on the gel) the network
    was trained without.
    """
    low, high = cloud.min(), cloud.max()
    return 2 * (cloud - low) / (high - low) - 1
