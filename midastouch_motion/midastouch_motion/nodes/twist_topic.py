"""Twists, and wrenches, as messages."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TwistStamped, Vector3


def twist_of(msg: TwistStamped) -> np.ndarray:
    """The twist (6,) of a message: [v, omega], m/s and rad/s."""
    return np.array([getattr(each, axis) for each in (msg.twist.linear, msg.twist.angular) for axis in "xyz"])


def vectors(six: np.ndarray) -> tuple[Vector3, Vector3]:
    """The two halves of a twist or a wrench (6,)."""
    first, second = (Vector3(**dict(zip("xyz", half, strict=True))) for half in six.reshape(2, 3).tolist())
    return first, second
