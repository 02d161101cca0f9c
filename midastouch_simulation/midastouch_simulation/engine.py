"""Use of a physics engine's reports by a simulated camera: times of its images, and checks of the motion."""

from __future__ import annotations

import numpy as np

from midastouch_perception.sensor_model import MAX_PENETRATION

_MOST_DUE = 3  # images that may be late; with more, all but the newest are dropped, as by a camera that is not read
_MOST_SPEED = 5.0  # m/s; no arm slides a finger, or throws an object past one, that fast
_MOST_DEPTH = 2 * MAX_PENETRATION  # m; gel gives way by half as much


class Shutter:
    """Evenly spaced moments, `fps` per second, none of which lies ahead of the engine's newest state.

    If that state is older than the last image, the engine's time has jumped back, and the shutter continues from it.
    """

    def __init__(self, fps: float):
        self._period = round(1e9 / fps)
        self._last: int | None = None

    def due(self, newest: int) -> int | None:
        """Return the next moment [ns] and count it as taken; None if it is after `newest` [ns]."""
        if self._last is None or newest < self._last:
            self._last = newest
            return newest
        due = (newest - self._last) // self._period
        if not due:
            return None
        self._last += self._period * (due if due > _MOST_DUE else 1)
        return self._last

    def restart(self) -> None:
        """Begin again at the next state."""
        self._last = None


class MotionWatch:
    """Check of the engine's poses at the moments of the images.

    Args: timeout [s], by a clock that never stops, after which an engine without a new report counts as stopped.
    """

    def __init__(self, timeout: float):
        self._timeout = timeout
        self._heard: tuple[int | None, float] | None = None
        self._last: tuple[int, np.ndarray] | None = None

    def silence(self, newest: int | None, now: float) -> float:
        """Return the time since the engine's newest state changed; 0 within the timeout.

        Parameters
        ----------
        newest : stamp of that state [ns]
            None for an engine without motion, which is never silent.
        now : [s], by a clock that never stops

        Returns
        -------
        [s]
        """
        if newest is None or self._heard is None or self._heard[0] != newest:
            self._heard = newest, now
        silent = now - self._heard[1]
        return silent if silent > self._timeout else 0.0

    def jump(self, stamp: int, T_obj_gel: np.ndarray) -> str:
        """Return a message if the way to a pose is too fast for a motion; otherwise empty.

        Parameters
        ----------
        stamp : [ns]
        T_obj_gel : (4, 4)
        """
        last, self._last = self._last, (stamp, T_obj_gel)
        if last is None or stamp <= last[0]:
            return ""
        distance = float(np.linalg.norm(T_obj_gel[:3, 3] - last[1][:3, 3]))
        seconds = 1e-9 * (stamp - last[0])
        if distance <= _MOST_SPEED * seconds:
            return ""
        how_far = f"{1e3 * distance:.0f} mm within {1e3 * seconds:.0f} ms"
        return f"sensor and object jumped {how_far}: was one put down elsewhere, or do two nodes publish its frame?"

    def restart(self) -> None:
        """Forget the last pose, because the engine began again."""
        self._last = None


def too_deep(deepest: float) -> str:
    """Return a message if an object that is `deepest` m in the gel is too deep for a touch; otherwise empty."""
    if deepest <= _MOST_DEPTH:
        return ""
    return f"the object is {1e3 * deepest:.0f} mm in the gel, which gives way by {1e3 * MAX_PENETRATION:.0f} mm at most"
