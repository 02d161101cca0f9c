"""Tells an image stream that cannot be right: dark, blinded or frozen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_STRIDE = 4
_BLACK_MEAN = 10.0
_SATURATED_LEVEL = 250
_SATURATED_FRACTION = 0.25


@dataclass(frozen=True)
class ImageReport:
    """State of the newest image.

    Attributes:
        mean: mean level of all channels, 0...255.
        saturated: fraction of pixels with at least one channel at its limit.
        repeats: how many times in a row the image came again unchanged.
        problem: what is wrong, in words with the fix; empty when nothing is.
    """

    mean: float
    saturated: float
    repeats: int
    problem: str


class ImageHealth:
    """Looks at every sixteenth pixel of each image.

    Args:
        frozen_after: this many equal images in a row mean a frozen stream. A sensor's noise makes two equal images all
            but impossible.
    """

    def __init__(self, frozen_after: int) -> None:
        self._frozen_after = frozen_after
        self._previous: np.ndarray | None = None
        self._repeats = 0

    def update(self, image: np.ndarray) -> ImageReport:
        """Judges one (H, W, 3) uint8 image."""
        sample = np.ascontiguousarray(image[::_STRIDE, ::_STRIDE])
        equal = self._previous is not None and np.array_equal(sample, self._previous)
        self._repeats = self._repeats + 1 if equal else 0
        self._previous = sample
        mean = float(sample.mean())
        saturated = float((sample >= _SATURATED_LEVEL).any(axis=-1).mean())
        return ImageReport(mean, saturated, self._repeats, self._problem(mean, saturated))

    def _problem(self, mean: float, saturated: float) -> str:
        if self._repeats >= self._frozen_after:
            return f"image frozen: {self._repeats} equal images in a row; replug the sensor"
        if mean < _BLACK_MEAN:
            return f"image black (mean {mean:.1f} of 255): check `intensity` and the LEDs"
        if saturated > _SATURATED_FRACTION:
            return f"image saturated ({saturated:.0%} of the pixels): lower `intensity`"
        return ""
