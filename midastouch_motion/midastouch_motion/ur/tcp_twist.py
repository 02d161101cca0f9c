"""Twists of the gel as twists of the TCP, which `speedL` of a UR moves.

A twist (6,) is [v, omega], m/s and rad/s: the velocity of a frame's origin and its angular velocity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from midastouch_common import se3


def twist_of_tcp(twist: np.ndarray, tcp_from_gel: np.ndarray) -> np.ndarray:
    """Return the twist of the TCP, along its axes.

    Both are fixed to the same tool, so that a turn about the gel's apex also moves the TCP.

    Parameters
    ----------
    twist : (6,) of the gel, along its axes
    tcp_from_gel : `T_tcp_gel` (4, 4)

    Returns
    -------
    (6,)
    """
    rotation, apex = tcp_from_gel[:3, :3], tcp_from_gel[:3, 3]
    turned = se3.turn(rotation) @ twist
    turned[:3] += np.cross(apex, turned[3:])
    return turned


def along_base(twist: np.ndarray, base_from_tcp: np.ndarray) -> np.ndarray:
    """Return a twist (6,) of the TCP along the axes of `base`, from that along its own; base_from_tcp: T_base_tcp."""
    return se3.turn(base_from_tcp[:3, :3]) @ twist


@dataclass(frozen=True)
class TwistLimits:
    """Limits of twists: those in another frame, faster ones (m/s, rad/s) and those that are not finite are refused."""

    frame: str
    speed: float
    turn_speed: float

    def refusal(self, frame: str, twist: np.ndarray) -> str:
        """Return why a twist is refused; empty if it is not.

        Parameters
        ----------
        frame
        twist : (6,) in that frame [m/s, rad/s]
        """
        if frame != self.frame:
            return f"a twist in '{frame}', not in '{self.frame}'"
        if not np.isfinite(twist).all():
            return "a twist that is not finite"
        speed, turn_speed = np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:])
        if speed > self.speed:
            return f"a twist of {speed:.3g} m/s, faster than max_speed, {self.speed:g} m/s"
        if turn_speed > self.turn_speed:
            return f"a twist of {turn_speed:.3g} rad/s, faster than max_turn_speed, {self.turn_speed:g} rad/s"
        return ""
