"""How much of the work that is done in slices a frame is given: in proportion to the time since the last one.

So it takes the same part of a core at every frame rate, and a fast camera's next image does not have to wait for it.
On a machine that is too slow for that, who calls says when the time is up, and the work takes more frames.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from ..core.noise_model import Effort

InTime = Callable[[], bool]
"""Says whether there is time left before the next frame."""

_OF_THE_FRAME = 0.5  # the other half is for networks in the same process
_LEAST = 0.25  # of what a frame is given, that is done when its time is up: else nothing would ever be sure


def always() -> bool:
    """There is."""
    return True


def until_next_frame(elapsed: float | None, clock: Callable[[], float] = time.perf_counter) -> InTime:
    """For a frame that begins now, `elapsed` [s] after the last one (None: unknown, so nothing waits for its end)."""
    if elapsed is None:
        return always
    end = clock() + _OF_THE_FRAME * elapsed
    return lambda: clock() < end


class Pace:
    """What searches and likelihoods that share it may do until the next frame.

    Args: effort.
    Attributes: lookups, alignments, numbers of them that the present frame is given.
    """

    def __init__(self, effort: Effort):
        self._effort, self._looked_up = effort, 0
        self.grant(None)

    def grant(self, elapsed: float | None, in_time: InTime = always) -> None:
        """A frame came `elapsed` [s] after the last one; None: unknown, so the longest that counts."""
        longest = self._effort.longest
        seconds = longest if elapsed is None else min(elapsed, longest)
        self.lookups = max(round(self._effort.lookups_per_second * seconds), 1)
        self.alignments = max(round(self._effort.alignments_per_second * seconds), 1)
        self._in_time = in_time

    def leaves(self, done: int, most: int) -> bool:
        """Whether a frame that is given `most` of something goes on after so much."""
        return done < most and (done < _LEAST * most or self._in_time())

    def used_up_by(self, lookups: int) -> bool:
        """Count so many look-ups that are about to be done; whether they have to wait for the next frame."""
        self._looked_up += lookups
        if self.leaves(self._looked_up - 1, self.lookups):
            return False
        self._looked_up = lookups
        return True
