"""What touches the sensor, decided on the penetration map, with hysteresis.

Two depths are told apart. *Penetration* is the shape within the contact: how far the object reaches above the contact's
own outline; codes and alignment compare it with what is rendered. *Depth* is how far the gel's deepest point lies below
the untouched gel, as an arm was commanded: soft gel sinks in beside a contact, so it is larger.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from .sensor_model import SensorModel

# Metres. Far below what the depth network can distinguish, far above what a cloud's float32 loses.
_STEP = np.float32(1e-6)
TOUCHED = 3e-5
"""Penetration [m] from which a pixel counts as touched."""


def in_steps(penetration: np.ndarray) -> np.ndarray:
    """Penetration [m] rounded to 1 um: exactly the same whether it is held as a map or went through a cloud.

    Without it the two would differ in the last bit, which a particle filter turns into another random run.
    """
    return np.rint(penetration / _STEP) * _STEP


@dataclasses.dataclass(frozen=True)
class Contact:
    """Attributes: penetration (H, W) float32 m in steps of 1 um, 0 where nothing touches; area_m2, of the touched gel,
    and depth_m, of its deepest point below the untouched gel, both 0 without contact."""

    penetration: np.ndarray
    area_m2: float
    depth_m: float

    @classmethod
    def of(cls, penetration: np.ndarray, sensor: SensorModel) -> Contact:
        """The contact with this penetration map (H, W) m on gel that does not sink in beside it; sensor: at the map's
        resolution."""
        return cls(penetration, float(np.count_nonzero(penetration) * sensor.pixel_area), float(penetration.max()))

    @property
    def in_contact(self) -> bool:
        """Whether anything touches."""
        return self.area_m2 > 0


class ContactDetector:
    """Contact begins above one area and ends below a smaller one, so that it does not flicker.

    The areas are small on purpose: a 2 mm wire is a contact too (paper appendix G). Args: sensor, at the map's
    resolution; begin, end: areas [m^2].
    """

    def __init__(self, sensor: SensorModel, begin: float = 1.5e-6, end: float = 0.8e-6):
        self._sensor = sensor
        self._begin, self._end = begin, end
        self._touching = False

    def update(self, penetration: np.ndarray) -> Contact:
        """The contact in one penetration map (H, W) m of the depth network."""
        touched = np.where(penetration > TOUCHED, penetration, np.float32(0))
        contact = Contact.of(in_steps(touched), self._sensor)
        self._touching = contact.area_m2 >= (self._end if self._touching else self._begin)
        return contact if self._touching else self._nothing()

    def free(self) -> Contact:
        """A frame that was seen to be free of contact by other means."""
        self._touching = False
        return self._nothing()

    def _nothing(self) -> Contact:
        return Contact(np.zeros((self._sensor.height, self._sensor.width), np.float32), 0.0, 0.0)
