"""Is the sensor touching anything? Decided on the penetration map, with hysteresis."""

from __future__ import annotations

import dataclasses

import numpy as np

from .sensor_model import SensorModel


@dataclasses.dataclass(frozen=True)
class Contact:
    """Attributes: in_contact; area_m2, of the touched gel; mask (H, W) bool, touched pixels."""

    in_contact: bool
    area_m2: float
    mask: np.ndarray


class ContactDetector:
    """Contact begins above one area and ends below a smaller one, so that it does not flicker.

    The areas are small on purpose: a 2 mm wire is a contact too (paper appendix G). Args: sensor, at the map's
    resolution; begin, end: areas [m^2]; depth [m], penetration from which a pixel counts.
    """

    def __init__(self, sensor: SensorModel, begin: float = 1.5e-6, end: float = 0.8e-6, depth: float = 3e-5):
        self._pixel_area = sensor.pixel_area
        self._begin, self._end, self._depth = begin, end, depth
        self._touching = False

    def update(self, penetration: np.ndarray) -> Contact:
        """The contact seen in one penetration map (H, W) m."""
        mask = penetration > self._depth
        area = float(np.count_nonzero(mask) * self._pixel_area)
        self._touching = area >= (self._end if self._touching else self._begin)
        return Contact(self._touching, area, mask)

    def free(self) -> None:
        """Note a frame that was seen to be free of contact by other means."""
        self._touching = False
