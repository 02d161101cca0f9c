"""Reach of an arm's gel: a box, and a cone of directions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from midastouch_common.errors import InputError


class Reach:
    """Poses of the gel that the arm may go to.

    Parameters
    ----------
    low, high : (3,) corners of a box in the base frame [m]
    cone : largest angle between the z axes of gel and base [rad]
        pi for every direction.
    asks
        True if plans also ask by `CheckReach`.

    Raises
    ------
    InputError
        The box is empty.
    """

    def __init__(self, low: Sequence[float], high: Sequence[float], cone: float, asks: bool = False):
        self.asks = asks
        self._low, self._high, self._least = np.array(low), np.array(high), np.cos(cone)
        if not (self._low < self._high).all():
            raise InputError(
                f"the box of reach from {list(low)} to {list(high)} m is empty: give reach_low and reach_high, corners "
                "of where it may touch"
            )

    def holds(self, poses: np.ndarray) -> bool:
        """Return whether all of these poses T_base_gel (N, 4, 4) can be reached."""
        position = poses[:, :3, 3]
        # rounding must not put an upright gel outside of a cone of 0
        upright = poses[:, 2, 2] >= self._least - 1e-9
        return bool((upright & ((self._low <= position) & (position <= self._high)).all(axis=1)).all())


EVERYWHERE = Reach([-np.inf] * 3, [np.inf] * 3, np.pi)
