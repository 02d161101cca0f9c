"""Limit of single-touch localisation: the penetration map of a touch is compared with every pose of a book.

Each pose is aligned with the map, as in the filter, and the poses that explain most of it are the matches. With the
true map no method can do better; with the measured map, no code made of it can.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.touch import MAP_SCALE, Measurement, reduced_penetration
from midastouch_perception.sensor_model import SensorModel

from .matches import TOP

BOOK = 3000
"""Number of poses of the book; a map then takes some seconds."""


def exhaustive_matches(
    mesh: ObjectMesh,
    sensor: SensorModel,
    poses: np.ndarray,
    maps: np.ndarray,
    rng: np.random.Generator,
    progress: Callable[[int], object] = lambda maps: None,
) -> np.ndarray:
    """Return the entries (Q, min(TOP, M)) of a book of poses (M, 4, 4) `T_obj_gel` that explain most of each of the
    penetration maps (Q, H, W) m; they come in no order. An empty map is matched by chance.

    sensor: at image resolution. progress: called with 1 after each map.
    """
    noise = NoiseModel.of(FilterConfig())
    alignment = PenetrationAlignment(mesh, sensor.scaled(MAP_SCALE), noise)
    order = rng.permutation(len(poses))
    spread = np.tile(noise.between_entries, (len(poses), 1, 1))
    top = min(TOP, len(poses))
    out = np.empty((len(maps), top), np.int64)
    for row, penetration in zip(out, maps, strict=True):
        touch = Measurement(True, penetration=reduced_penetration(penetration))
        explained: np.ndarray = np.zeros(len(poses))
        if penetration.any():
            explained = alignment.align_each(poses[order], spread, [touch]).fits[:, 0]
        row[:] = order[np.argpartition(-explained, top - 1)[:top]]
        progress(1)
    return out
