"""Twists as messages."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TwistStamped


def twist_of(msg: TwistStamped) -> np.ndarray:
    """The twist (6,) of a message: [v, omega], m/s and rad/s."""
    return np.array([getattr(each, axis) for each in (msg.twist.linear, msg.twist.angular) for axis in "xyz"])
