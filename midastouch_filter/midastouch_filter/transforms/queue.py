"""What arrives before its transform waits here, in order: the work of tf2's message filter."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from midastouch_common.errors import InputError

from .rigid import TransformError

# Shorter waits are not reported: live, transforms often come some milliseconds after their image.
_UNREPORTED_WAIT_S = 0.05
# Bounds the memory while the clock of the time-out stands still: more than a minute of a sensor's codes.
MOST_WAITING = 4096


@dataclass(frozen=True)
class Wait:
    """The transform is not there yet but may still come; `reason` says what is missing."""

    reason: str


@dataclass(frozen=True)
class Ready:
    """What left the queue: stamp [ns], what was put in, and its transform (4, 4), or None and the reason."""

    stamp: int
    payload: Any
    transform: np.ndarray | None
    reason: str = ""


@dataclass(frozen=True)
class Waiting:
    """Stamp [ns] of the newest item, and what the first one waits for."""

    stamp: int
    reason: str


class TransformQueue:
    """First in, first out; the first one waits for its transform, for the time-out or until too many wait behind it.

    lookup: stamp [ns] -> (4, 4) or `Wait`; raises TransformError or InputError when there is no hope.
    hold: stamp, payload, seconds since it was put in -> whether something else is still to come. Seconds by `steady`,
    a clock that never stops; since it was put in, not since it became the first: else items that wait in vain, one
    after the other, would hold up those behind them ever longer.
    now, timeout: functions that return seconds, of the wait for the transform.
    """

    def __init__(
        self,
        lookup: Callable[[int], np.ndarray | Wait],
        hold: Callable[[int, Any, float], bool],
        now: Callable[[], float],
        timeout: Callable[[], float],
        steady: Callable[[], float],
    ):
        self._lookup, self._hold, self._now, self._timeout, self._steady = lookup, hold, now, timeout, steady
        self._items: deque[tuple[int, Any, float, float]] = deque()
        self._lacks = ""
        self._reported: int | None = None

    def __len__(self) -> int:
        return len(self._items)

    def push(self, stamp: int, payload: Any) -> None:
        """Queue `payload` until its transform at `stamp` [ns] is there."""
        self._items.append((stamp, payload, self._now(), self._steady()))

    def remove(self, stamp: int) -> None:
        """Forget what waits at `stamp` [ns], if it does."""
        self._items = deque(item for item in self._items if item[0] != stamp)

    def clear(self) -> list[int]:
        """Forget everything that waits; returns the stamps [ns]."""
        stamps = [stamp for stamp, *_ in self._items]
        self._items.clear()
        self._reported = None
        return stamps

    def unreported(self) -> Waiting | None:
        """Once for each item that is the newest while the first has waited for a while; else None."""
        if not self._items:
            return None
        stamp = self._items[-1][0]
        if stamp == self._reported or self._steady() - self._items[0][3] < _UNREPORTED_WAIT_S:
            return None
        self._reported = stamp
        return Waiting(stamp, self._lacks)

    def pop(self) -> Ready | None:
        """The first item if its wait is over, else None."""
        if not self._items:
            return None
        stamp, payload, arrival, steady_arrival = self._items[0]
        if self._hold(stamp, payload, self._steady() - steady_arrival):
            self._lacks = "what belongs to this frame is still to come"
            return None
        try:
            found = self._lookup(stamp)
        except (TransformError, InputError) as error:
            ready = Ready(stamp, payload, None, str(error))
        else:
            waited = self._now() - arrival
            if not isinstance(found, Wait):
                ready = Ready(stamp, payload, found)
            elif waited < self._timeout() and len(self._items) <= MOST_WAITING:
                self._lacks = f"no transform yet: {found.reason}"
                return None
            else:
                ready = Ready(stamp, payload, None, f"{found.reason} (waited {waited:.1f} s)")
        self._items.popleft()
        return ready
