"""What perception makes of an image, as the filter takes it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .touch import Measurement, reduced_penetration

if TYPE_CHECKING:
    from midastouch_perception.pipeline import Touch


def measurement_of(touch: Touch) -> Measurement:
    """The measurement of one touch, with its penetration map."""
    contact = touch.contact
    penetration = reduced_penetration(contact.penetration) if contact.in_contact else None
    return Measurement(contact.in_contact, touch.code, contact.area_m2, touch.network_id, penetration)


def measurement_from_msg(msg: Any) -> Measurement:
    """The measurement of a TactileCode message, without its map; its code is a read-only view of the message."""
    code = np.frombuffer(msg.code, np.float32) if msg.in_contact else None
    return Measurement(msg.in_contact, code, msg.contact_area, msg.network_id)
