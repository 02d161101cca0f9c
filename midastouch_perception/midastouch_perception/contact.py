"""Detection of contact in the penetration map, with hysteresis.

There are two depths. *Penetration* is the shape within the contact: the height of the object above the contact's own
outline; codes and alignment compare it with rendered maps. *Depth* is the distance of the gel's deepest point from the
untouched gel, which an arm was commanded to press. It is larger, because soft gel also sinks in around a contact.
"""

from __future__ import annotations

import dataclasses
import enum

import numpy as np

from .sensor_model import SensorModel

# Metres. Far below the depth network's resolution, far above the rounding error of a cloud's float32.
_STEP = np.float32(1e-6)
TOUCHED = 3e-5
"""Penetration [m] from which a pixel counts as touched."""
_KEPT = 0.95  # of a contact; one that slides on loses more from one image to the next


def in_steps(penetration: np.ndarray) -> np.ndarray:
    """Return penetration [m] rounded to 1 um, so that a map is exactly the same after conversion to a cloud and back.

    Without rounding the two differ in the last bit, which a particle filter turns into another random run.
    """
    return np.rint(penetration / _STEP) * _STEP


class ContactState(str, enum.Enum):
    """What a frame shows: an untouched gel; a contact; a contact that covers the view, so that its depth is only known
    to be at least that; a change that is neither understood as light nor as contact. Values as in `TactileContact`."""

    FREE = "free"
    CONTACT = "contact"
    SATURATED = "saturated"
    UNKNOWN = "unknown"

    @property
    def problem(self) -> str:
        """Why the depth cannot be read, and what to do; empty if it can."""
        return _PROBLEMS.get(self, "")


_PROBLEMS = {
    ContactState.SATURATED: "the contact covers the view, so it may be deeper than `depth` says: press less",
    ContactState.UNKNOWN: (
        "the image shows a change that is neither the light's nor a contact: if nothing touches, call "
        "capture_background; otherwise calibrate this sensor"
    ),
}


@dataclasses.dataclass(frozen=True)
class Contact:
    """Contact in one frame. Attributes: penetration (H, W) float32 m in steps of 1 um, 0 outside of the contact;
    area_m2 of the touched gel, and depth_m of its deepest point below the untouched gel, both 0 without contact;
    state."""

    penetration: np.ndarray
    area_m2: float
    depth_m: float
    state: ContactState

    @classmethod
    def of(cls, penetration: np.ndarray, sensor: SensorModel) -> Contact:
        """Return the contact of gel that does not sink in around it.

        Parameters
        ----------
        penetration : (H, W) [m]
        sensor
            At the map's resolution.
        """
        area = float(np.count_nonzero(penetration) * sensor.pixel_area)
        return cls(penetration, area, float(penetration.max()), ContactState.CONTACT if area else ContactState.FREE)

    @property
    def in_contact(self) -> bool:
        """True if an object touches the gel."""
        return self.area_m2 > 0

    def grown_from(self, last: Contact) -> bool:
        """Return whether this is the contact `last`, pressed further: the view cuts it off, it is larger, and it is
        still where `last` was. Such a contact is not less deep, though fewer of its slopes are in view."""
        if not last.in_contact or self.area_m2 < last.area_m2:
            return False
        touched, before = self.penetration > 0, last.penetration > 0
        cut_off = touched[[0, -1]].any() or touched[:, [0, -1]].any()
        kept = np.count_nonzero(touched & before) >= _KEPT * np.count_nonzero(before)
        return bool(cut_off and kept)


class ContactDetector:
    """Detector of contact with hysteresis: contact begins at one area and ends below a smaller one.

    The areas are small on purpose: a 2 mm wire is a contact, too (paper appendix G). Args: sensor, at the map's
    resolution; begin, end: areas [m^2].
    """

    def __init__(self, sensor: SensorModel, begin: float = 1.5e-6, end: float = 0.8e-6):
        self._sensor = sensor
        self._begin, self._end = begin, end
        self._touching = False

    def update(self, penetration: np.ndarray) -> Contact:
        """Return the contact in one penetration map (H, W) m of the depth network."""
        touched = np.where(penetration > TOUCHED, penetration, np.float32(0))
        contact = Contact.of(in_steps(touched), self._sensor)
        self._touching = contact.area_m2 >= (self._end if self._touching else self._begin)
        return contact if self._touching else self.no_contact()

    def no_contact(self, state: ContactState = ContactState.FREE) -> Contact:
        """Return no contact, for a frame that other means have found to be free of it, or not understood (`state`)."""
        self._touching = False
        return Contact(np.zeros((self._sensor.height, self._sensor.width), np.float32), 0.0, 0.0, state)
