"""Monitors of a stream: its rate, the evenness of its time stamps, and faults that its images show."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

_SHORTEST_WINDOW_S = 1.0
_FEWEST_FRAMES_PER_WINDOW = 5
_JITTER_FRAMES = 120
_FEWEST_JITTER_FRAMES = 30
_JITTER_PERCENTILE = 95
_PIXEL_STRIDE = 4
_BLACK_MEAN_LEVEL = 10.0
_SATURATED_LEVEL = 250
_SATURATED_FRACTION = 0.25


class RateMonitor:
    """Counter of stamps within a sliding window: one second, longer for slow sources.

    Args:
        fps: expected frames per second.
        now_ns: the time at the start, nanoseconds on the stamps' clock.
    """

    def __init__(self, fps: float, now_ns: int) -> None:
        self._window_ns = round(max(_SHORTEST_WINDOW_S, _FEWEST_FRAMES_PER_WINDOW / fps) * 1e9)
        self._start_ns = now_ns
        self._stamps: deque[int] = deque()

    def add(self, stamp_ns: int) -> None:
        """Count one frame."""
        self._stamps.append(stamp_ns)
        self._forget(stamp_ns)

    @property
    def backward(self) -> int:
        """Number of stamps in the window that were not later than the one before."""
        return sum(later <= earlier for earlier, later in pairwise(self._stamps))

    def rate(self, now_ns: int) -> float | None:
        """Return the frames per second in the window that ends now; None before one whole window has passed."""
        if now_ns - self._start_ns < self._window_ns:
            return None
        self._forget(now_ns)
        return len(self._stamps) / (self._window_ns * 1e-9)

    def _forget(self, now_ns: int) -> None:
        while self._stamps and self._stamps[0] <= now_ns - self._window_ns:
            self._stamps.popleft()


class JitterMonitor:
    """Monitor of the stamps of the last 120 frames.

    A camera exposes by a clock of its own, so its stamps lie on an even grid, from which lost frames are missing. A
    stamp off that grid is late: it was taken at reading instead of acquisition, or on a busy host. The image is then
    matched with a later pose of the arm: 5 ms are 0.15 mm at 30 mm/s.
    """

    def __init__(self) -> None:
        self._stamps: deque[tuple[int, int]] = deque(maxlen=_JITTER_FRAMES)

    def add(self, stamp_ns: int, sequence: int) -> None:
        """Note one frame: its stamp and the number that the source gave it."""
        self._stamps.append((stamp_ns, sequence))

    def jitter(self) -> float | None:
        """Return the 95th percentile of intervals' deviation from the median one, seconds; None for too few frames."""
        if len(self._stamps) < _FEWEST_JITTER_FRAMES:
            return None
        stamps, sequences = np.diff(np.array(self._stamps, dtype=np.int64), axis=0).T
        periods = np.maximum(sequences, 1)
        usual = np.median(stamps / periods)
        return float(np.percentile(np.abs(stamps - periods * usual), _JITTER_PERCENTILE)) * 1e-9


@dataclass(frozen=True)
class ImageReport:
    """State of the newest image.

    Attributes:
        mean: mean level of all channels, 0...255.
        saturated: fraction of pixels with at least one channel at its limit.
        repeats: how many times in a row the image came again unchanged.
        problem: a fault and its fix; empty if there is none.
    """

    mean: float
    saturated: float
    repeats: int
    problem: str


class ImageHealth:
    """Check of every sixteenth pixel of each image.

    Args:
        frozen_after: this many equal images in a row mean a frozen stream. A sensor's noise makes two equal images all
            but impossible.
    """

    def __init__(self, frozen_after: int) -> None:
        self._frozen_after = frozen_after
        self._previous: np.ndarray | None = None
        self._repeats = 0

    @property
    def frozen(self) -> bool:
        """True while the last images are equal."""
        return self._repeats >= self._frozen_after

    def update(self, image: np.ndarray) -> ImageReport:
        """Judge one (H, W, 3) uint8 image."""
        sample = np.ascontiguousarray(image[::_PIXEL_STRIDE, ::_PIXEL_STRIDE])
        equal = self._previous is not None and np.array_equal(sample, self._previous)
        self._repeats = self._repeats + 1 if equal else 0
        self._previous = sample
        mean = float(sample.mean())
        saturated = float((sample >= _SATURATED_LEVEL).any(axis=-1).mean())
        return ImageReport(mean, saturated, self._repeats, self._problem(mean, saturated))

    def _problem(self, mean: float, saturated: float) -> str:
        if self.frozen:
            return f"image frozen: {self._repeats} equal images in a row, not published; replug the sensor"
        if mean < _BLACK_MEAN_LEVEL:
            return f"image black (mean {mean:.1f} of 255): check `intensity` and the LEDs"
        if saturated > _SATURATED_FRACTION:
            return f"image saturated ({saturated:.0%} of the pixels): lower `intensity`"
        return ""
