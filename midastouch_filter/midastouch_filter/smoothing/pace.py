"""How much of the work that is done in slices a frame is given: in proportion to the time since the last one.

So it takes the same part of a core at every frame rate, and a fast camera's next image does not have to wait for it.
"""

from __future__ import annotations

from ..core.noise_model import Effort


class Pace:
    """What searches and likelihoods that share it may do until the next frame.

    Args: effort.
    Attributes: lookups, alignments, numbers of them in the present frame; at least one.
    """

    def __init__(self, effort: Effort):
        self._effort, self._looked_up = effort, 0
        self.grant(None)

    def grant(self, elapsed: float | None) -> None:
        """A frame came `elapsed` [s] after the last one; None: unknown, so the longest that counts."""
        longest = self._effort.longest
        seconds = longest if elapsed is None else min(elapsed, longest)
        self.lookups = max(round(self._effort.lookups_per_second * seconds), 1)
        self.alignments = max(round(self._effort.alignments_per_second * seconds), 1)

    def used_up_by(self, lookups: int) -> bool:
        """Count so many look-ups that are about to be done; whether they have to wait for the next frame."""
        self._looked_up += lookups
        if self._looked_up <= self.lookups:
            return False
        self._looked_up = lookups
        return True
