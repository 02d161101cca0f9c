"""What the code network sees of a contact: its relief in metric gel coordinates."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..sensor_model import SensorModel


def code_input(penetration: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Channels (N, 4, H/2, W/2) float32 of penetration maps (N, H, W) m: depth, contact, x, y.

    The map is averaged 2 x 2. Metric scale and the position in the gel frame, which the official code normalises
    away, are kept: x and y are the pixels' places on the gel.
    """
    n, height, width = penetration.shape
    # slices, not a mean over axes: that takes five times as long
    corners = [penetration[:, row::2, column::2] for row in (0, 1) for column in (0, 1)]
    out = np.empty((n, 4, height // 2, width // 2), np.float32)
    out[:, 0] = sum(corners) * np.float32(1e3 / 4)
    out[:, 1] = sum((corner > 0).astype(np.float32) for corner in corners) / 4
    out[:, 2:] = _places(sensor)
    return out


@lru_cache(maxsize=16)
def _places(sensor: SensorModel) -> np.ndarray:
    """x and y (2, H/2, W/2) float32 of the halved map's pixels on the gel, in centimetres."""
    coarse = sensor.scaled(0.5)
    return (np.stack(coarse.rays) * coarse.gel_depth * 100).astype(np.float32)
