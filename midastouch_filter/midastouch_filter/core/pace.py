"""Time left before the next frame, for work that is done once the answer is out."""

from __future__ import annotations

import time
from collections.abc import Callable

InTime = Callable[[], bool]
"""Function that returns whether there is time left before the next frame."""

_OF_THE_FRAME = 0.5  # fraction of the frame's time; the rest is for networks in the same process


def always() -> bool:
    """Return True: there is always time."""
    return True


def until_next_frame(elapsed: float | None, clock: Callable[[], float] = time.perf_counter) -> InTime:
    """Return the `InTime` of a frame that begins now.

    Parameters
    ----------
    elapsed : [s] since the last frame
        None if unknown: then the result is `always`.
    clock
        Returns seconds.
    """
    if elapsed is None:
        return always
    end = clock() + _OF_THE_FRAME * elapsed
    return lambda: clock() < end
