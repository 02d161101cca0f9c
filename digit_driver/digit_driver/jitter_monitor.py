"""How evenly the time stamps of a stream are spaced."""

from __future__ import annotations

from collections import deque

import numpy as np

_FRAMES = 120
_FEWEST = 30
_SHARE = 95  # percent


class JitterMonitor:
    """Looks at the stamps of the last 120 frames.

    A camera exposes by a clock of its own, so its stamps lie on an even grid, of which lost frames leave out points.
    What is off that grid was stamped late (by reading instead of acquisition, by a host without time for it), and an
    image is then matched with where the arm is a moment later: 5 ms are 0.15 mm at 30 mm/s.
    """

    def __init__(self) -> None:
        self._stamps: deque[tuple[int, int]] = deque(maxlen=_FRAMES)

    def add(self, stamp_ns: int, sequence: int) -> None:
        """Takes note of one frame: its stamp and the number that the source gave it."""
        self._stamps.append((stamp_ns, sequence))

    def jitter(self) -> float | None:
        """Seconds by which all but one in twenty intervals are at most off the usual one; None for too few frames."""
        if len(self._stamps) < _FEWEST:
            return None
        stamps, sequences = np.diff(np.array(self._stamps, dtype=np.int64), axis=0).T
        periods = np.maximum(sequences, 1)
        usual = np.median(stamps / periods)
        return float(np.percentile(np.abs(stamps - periods * usual), _SHARE)) * 1e-9
