"""The sensor's no-contact image from images that arrive: captured on request, or estimated from the first ones."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from .background import estimate_background

_BLOCK = 16  # px


def largest_change(images: Sequence[np.ndarray]) -> float:
    """Largest change [grey levels] of any 16 x 16 block's mean against the first image.

    Block means make it blind to pixel noise (a few grey levels) and sharp for a small contact that moves.
    """
    means = np.stack(
        [cv2.resize(i, None, fx=1 / _BLOCK, fy=1 / _BLOCK, interpolation=cv2.INTER_AREA) for i in images]
    ).astype(np.float32)
    return float(np.abs(means - means[0]).max())


class BackgroundCapture:
    """Collects `frames` images; then `image` is the background, or `refusal` says why there is none."""

    def __init__(self, frames: int, still_threshold: float):
        self._frames, self._still_threshold = frames, still_threshold
        self._images: list[np.ndarray] = []
        self.image: np.ndarray | None = None
        self.refusal = ""

    @property
    def done(self) -> bool:
        """Whether enough images have come."""
        return len(self._images) >= self._frames

    def add(self, image: np.ndarray) -> None:
        """One more image (H, W, 3) uint8."""
        self._images.append(image)
        if not self.done:
            return
        change = largest_change(self._images)
        if change > self._still_threshold:
            self.refusal = (
                f"the image is not still: it changed by {change:.1f} grey levels over {self._frames} frames "
                f"(limit {self._still_threshold:.1f}); lift the finger off, hold it still and try again"
            )
        else:
            self.image = estimate_background(self._images)


class RunningBackground:
    """Background from the first images of a stream: good from the start where those show no contact.

    It is estimated anew after 1, 2, 4, ... images, up to `frames` of them.
    """

    def __init__(self, frames: int):
        self._frames = frames
        self._images: list[np.ndarray] = []
        self.count = 0
        self.image: np.ndarray | None = None
        self.change = 0.0

    def add(self, image: np.ndarray) -> None:
        """One more image (H, W, 3) uint8."""
        if self.count == self._frames:
            return
        self._images.append(image)
        self.count += 1
        if self.count == self._frames or self.count & (self.count - 1) == 0:
            self.image = estimate_background(self._images)
            self.change = largest_change(self._images)
        if self.count == self._frames:
            self._images.clear()
