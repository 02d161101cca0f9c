"""When a simulated camera takes its images, in the time of the engine that moves it."""

from __future__ import annotations

_MOST_DUE = 3  # images: what is further behind is left out, as a camera does that nobody reads


class Shutter:
    """Gives evenly spaced moments, `fps` a second, none of which lies ahead of the engine's newest state.

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
