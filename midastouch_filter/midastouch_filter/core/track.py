"""Path of the gel by odometry: where it touched, how far it has moved since, and where it was in the air."""

from __future__ import annotations

from collections import deque

import numpy as np

from midastouch_common import se3
from midastouch_common.pose_metric import pose_distance

from .motion_model import Odometry

_LIFT = 0.01  # m of path without contact; less is a gap in a slide
_KEPT = 256  # last touches since a lift whose poses are kept
_AIR_SPACING, _AIR_KEPT = 3e-3, 24  # m between poses in the air; number of the last ones that are kept


class Track:
    """Path of the first finger's gel.

    Args: spacing [m] of keyframes along the path, turns included. Nearer touches see nearly the same patch.
    Attributes: motion (4, 4) since the start; odometer [m], path since the start; path [m] since the last keyframe,
    turns included; lifted, whether the gel was lifted since the last keyframe.
    """

    def __init__(self, spacing: float):
        self._spacing = spacing
        self.restart()

    def restart(self) -> None:
        """Forget everything."""
        self.motion, self.odometer, self.path, self.lifted = np.eye(4), 0.0, np.inf, False
        self._in_air, self._keyframe = 0.0, np.empty((0, 4, 4))
        self._air: deque[np.ndarray] = deque(maxlen=_AIR_KEPT)
        self._touched_at: deque[np.ndarray] = deque(maxlen=_KEPT)

    def force(self) -> None:
        """Make the next touch a keyframe that counts as a new touch, even at rest."""
        self.path = np.inf
        self._touched_at.clear()

    def moved(self, motion: Odometry | None, in_contact: bool) -> None:
        """Add a motion of the gel; None if it did not move or if its motion is unknown."""
        if motion is not None:
            self.motion = self.motion @ motion.transform
            self.odometer += motion.path
            self.path += motion.path
        if in_contact:
            self._in_air = 0.0
            return
        self._in_air += motion.path if motion is not None else 0.0
        self.lifted |= len(self._keyframe) > 0 and self._in_air > _LIFT
        if not self._air or pose_distance(self._air[-1], self.motion) > _AIR_SPACING:
            self._air.append(self.motion)

    def is_due(self, gels: np.ndarray) -> bool:
        """Return whether a touch by gels (F, 4, 4), in the frame of the first one, should be a keyframe: any of them is
        far enough from the last keyframe, or a further finger touches."""
        if self.path >= self._spacing or len(gels) > len(self._keyframe):
            return True
        away = pose_distance(self._keyframe[:, None], self.motion @ gels).min(axis=0)
        return bool(away.max() >= self._spacing)

    def keep(self, gels: np.ndarray) -> np.ndarray:
        """Make the present touch, by gels (F, 4, 4) in the frame of the first one, a keyframe, and return how much of a
        new touch each is, (F,) in [0, 1]."""
        if self.lifted:
            self._touched_at.clear()
        here = self.motion @ gels
        weights = np.ones(len(gels))
        if self._touched_at:
            away = pose_distance(np.stack(self._touched_at)[:, None], here).min(axis=0)
            weights = np.minimum(away / self._spacing, 1.0)
        self._touched_at.extend(here)
        self.path, self.lifted, self._keyframe = 0.0, False, here
        return weights

    def free_space(self) -> np.ndarray:
        """Return the gels (A, 4, 4) that were in the air since the last call, in the frame of the present one."""
        seen, self._air = list(self._air), deque(maxlen=_AIR_KEPT)
        return se3.inverse(self.motion) @ np.stack(seen) if seen else np.empty((0, 4, 4))

    @property
    def touched(self) -> np.ndarray:
        """Gels (F, 4, 4) that have touched since the last lift, in the frame of the present one."""
        if not self._touched_at or self.lifted:
            return np.empty((0, 4, 4))
        return se3.inverse(self.motion) @ np.stack(self._touched_at)
