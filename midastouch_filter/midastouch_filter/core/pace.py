"""Whether there is time left before the next frame, for work that is done once the answer is out."""

from __future__ import annotations

import time
from collections.abc import Callable

InTime = Callable[[], bool]
"""Says whether there is time left before the next frame."""

_OF_THE_FRAME = 0.5  # the other half is for networks in the same process


def always() -> bool:
    """There is."""
    return True


def until_next_frame(elapsed: float | None, clock: Callable[[], float] = time.perf_counter) -> InTime:
    """For a frame that begins now, `elapsed` [s] after the last one (None: unknown, so nothing waits for its end)."""
    if elapsed is None:
        return always
    end = clock() + _OF_THE_FRAME * elapsed
    return lambda: clock() < end
