"""Queue of items that arrive before their transforms: the work of tf2's message filter."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .rigid import TransformError

# Shorter waits are not reported: live, transforms often come some milliseconds after their image.
_UNREPORTED_WAIT_S = 0.05
# Limits the memory while the clock of the time-out stands still: more than a minute of a sensor's codes.
MOST_WAITING = 4096


@dataclass(frozen=True)
class Wait:
    """Answer of a look-up whose transform may still come; `reason` says what is missing."""

    reason: str


@dataclass(frozen=True)
class Ready:
    """Item that left the queue: stamp [ns], payload, and its transform (4, 4), or None and the reason."""

    stamp: int
    payload: Any
    transform: np.ndarray | None
    reason: str = ""


@dataclass(frozen=True)
class Waiting:
    """Stamp [ns] of the newest item, and the reason why the first one waits."""

    stamp: int
    reason: str


class TransformQueue:
    """First-in, first-out queue; the first item waits for its transform, a time-out, or too many items behind it.

    Parameters
    ----------
    lookup
        From a stamp [ns] to (4, 4) or `Wait`; raises TransformError or InputError if the transform will never come.
    hold
        Called with stamp, payload, and seconds in the queue; True if something else is still to come. The seconds count
        from `push`, not from when the item became the first: otherwise each item whose wait is useless would add its
        own delay to those behind it.
    now, timeout
        Return seconds, for the wait for the transform.
    steady : clock [s] of the time in the queue; it never stops
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

    @property
    def lacks(self) -> str:
        """What the first item waits for; "" for an empty queue."""
        return self._lacks if self._items else ""

    def push(self, stamp: int, payload: Any) -> None:
        """Queue an item until its transform is known.

        Parameters
        ----------
        stamp : time [ns] of the transform
        payload
            Returned with the transform.
        """
        self._items.append((stamp, payload, self._now(), self._steady()))

    def remove(self, stamp: int) -> None:
        """Forget the item of `stamp` [ns], if there is one."""
        self._items = deque(item for item in self._items if item[0] != stamp)

    def clear(self) -> list[int]:
        """Forget all items and return their stamps [ns]."""
        stamps = [stamp for stamp, *_ in self._items]
        self._items.clear()
        self._reported = None
        return stamps

    def unreported(self) -> Waiting | None:
        """Return a `Waiting` once for each newest item, if the first has waited for a while; otherwise None."""
        if not self._items:
            return None
        stamp = self._items[-1][0]
        if stamp == self._reported or self._steady() - self._items[0][3] < _UNREPORTED_WAIT_S:
            return None
        self._reported = stamp
        return Waiting(stamp, self._lacks)

    def pop(self) -> Ready | None:
        """Remove and return the first item if its wait is over, otherwise None."""
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
