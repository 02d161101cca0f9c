"""Twists as messages."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TwistStamped

from midastouch_common.errors import InputError


def finite_twist(msg: TwistStamped, frame: str) -> np.ndarray:
    """The twist (6,), m/s and rad/s; InputError unless it is finite and in this frame."""
    twist = np.array([getattr(each, axis) for each in (msg.twist.linear, msg.twist.angular) for axis in "xyz"])
    if msg.header.frame_id != frame or not np.isfinite(twist).all():
        raise InputError(f"a twist in '{msg.header.frame_id}' is no finite one in '{frame}'")
    return twist
