"""What an engine's reports mean to a simulated camera: when it takes images, and what is odd about the motion."""

from __future__ import annotations

import numpy as np

from ..rendering.contact_poses import MAX_PENETRATION

_MOST_DUE = 3  # images: what is further behind is left out, as a camera does that nobody reads
_MOST_SPEED = 5.0  # m/s: no arm slides a finger, and none throws an object past it, that fast
_MOST_DEPTH = 2 * MAX_PENETRATION  # m: gel gives way by half as much


class Shutter:
    """Evenly spaced moments, `fps` a second, none of which lies ahead of the engine's newest state.

    If that is older than the last image, time has run back, and the shutter goes on from there.
    """

    def __init__(self, fps: float):
        self._period = round(1e9 / fps)
        self._last: int | None = None

    def due(self, newest: int) -> int | None:
        """The next moment [ns], if it is not after `newest` [ns]; it counts as taken."""
        if self._last is None or newest < self._last:
            self._last = newest
            return newest
        due = (newest - self._last) // self._period
        if not due:
            return None
        self._last += self._period * (due if due > _MOST_DUE else 1)
        return self._last

    def restart(self) -> None:
        """Begin anew at whatever moment is the newest then."""
        self._last = None


class MotionWatch:
    """Looks at the engine's poses at the moments of the images.

    Args: timeout [s] of a clock that never stops, after which an engine that reports nothing new has stopped.
    """

    def __init__(self, timeout: float):
        self._timeout = timeout
        self._heard: tuple[int | None, float] | None = None
        self._last: tuple[int, np.ndarray] | None = None

    def silence(self, newest: int | None, now: float) -> float:
        """Seconds since the engine's newest state, of stamp `newest` [ns], changed; 0 within the timeout.

        newest is None for an engine without motion, which is never silent. now [s], by a clock that never stops.
        """
        if newest is None or self._heard is None or self._heard[0] != newest:
            self._heard = newest, now
        silent = now - self._heard[1]
        return silent if silent > self._timeout else 0.0

    def jump(self, stamp: int, T_obj_gel: np.ndarray) -> str:
        """Why the way to this pose (4, 4) at `stamp` [ns] is no motion, in words; empty if it is one."""
        last, self._last = self._last, (stamp, T_obj_gel)
        if last is None or stamp <= last[0]:
            return ""
        distance = float(np.linalg.norm(T_obj_gel[:3, 3] - last[1][:3, 3]))
        seconds = 1e-9 * (stamp - last[0])
        if distance <= _MOST_SPEED * seconds:
            return ""
        how_far = f"{1e3 * distance:.0f} mm within {1e3 * seconds:.0f} ms"
        return f"sensor and object jumped {how_far}: was one set down anew, or do two publish its frame?"

    def restart(self) -> None:
        """The engine began anew: what came before is no pose to move from."""
        self._last = None


def too_deep(deepest: float) -> str:
    """Why an object that is `deepest` m in the gel is no touch, in words; empty if it is one."""
    if deepest <= _MOST_DEPTH:
        return ""
    return f"the object is {1e3 * deepest:.0f} mm in the gel, which gives way by {1e3 * MAX_PENETRATION:.0f} mm at most"
