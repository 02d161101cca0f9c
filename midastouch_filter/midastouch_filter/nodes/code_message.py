"""TactileCode messages -> what the filter takes."""

from __future__ import annotations

import numpy as np

from midastouch_msgs.msg import TactileCode

from ..touch import Measurement


def measurement_from_msg(msg: TactileCode) -> Measurement:
    """The touch without its relief; its code is a read-only view of the message."""
    code = np.frombuffer(msg.code, np.float32) if msg.in_contact else None
    return Measurement(msg.in_contact, code, msg.contact_area, msg.network_id)
