"""The robot controller's time stamps on our clock."""

from __future__ import annotations

from collections import deque


class RobotClock:
    """Maps seconds since the controller's start to nanoseconds of our clock, re-estimated all the time.

    A state arrives some transport and polling delay after it was measured, never before. The smallest
    difference (arrival - robot time) of the last `window_s` seconds is therefore the offset between the
    clocks with the least delay in it. The window is short enough for the clocks not to drift apart in it
    (50 ppm are 0.1 ms in 2 s) and forgets steps of either clock.
    """

    def __init__(self, window_s: float = 2.0):
        self._window_ns = round(window_s * 1e9)
        # sliding minimum: (robot time, offset), both ascending
        self._offsets: deque[tuple[int, int]] = deque()
        self._last: int | None = None

    def stamp(self, robot_time_s: float, arrival_ns: int) -> int:
        """Time (ns, our clock) at which the state of `robot_time_s` was measured."""
        now = round(robot_time_s * 1e9)
        if self._last is not None and now < self._last:
            self._offsets.clear()  # the controller was restarted
        self._last = now
        offset = arrival_ns - now
        while self._offsets and self._offsets[-1][1] >= offset:
            self._offsets.pop()
        self._offsets.append((now, offset))
        while self._offsets[0][0] < now - self._window_ns:
            self._offsets.popleft()
        return now + self._offsets[0][1]
