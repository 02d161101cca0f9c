"""The sensor's no-contact image: read from a file, captured on request, or estimated while images arrive.

ROS-free: the node feeds images in and asks for the current background.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from ..errors import InputError

_BLOCK = 16


def read_background(path: str | Path, height: int, width: int) -> np.ndarray:
    """RGB image (height, width, 3) uint8 of a file; InputError if it is none or of another size."""
    if not Path(path).is_file():
        raise InputError(f"{path}: no such background image; leave the parameter empty to estimate one")
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: not an image; use PNG or JPEG")
    if image.shape[:2] != (height, width):
        raise InputError(
            f"{path}: {image.shape[1]} x {image.shape[0]} pixels, the sensor model has {width} x {height}"
        )
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def largest_change(images: Sequence[np.ndarray]) -> float:
    """Largest change [grey levels] of any 16 x 16 block's mean against the first image.

    Block means make it blind to pixel noise (a few grey levels) and sharp for a small contact that moves.
    """
    means = np.stack(
        [cv2.resize(i, None, fx=1 / _BLOCK, fy=1 / _BLOCK, interpolation=cv2.INTER_AREA) for i in images]
    ).astype(np.float32)
    return float(np.abs(means - means[0]).max())


class BackgroundCapture:
    """Collects `frames` images; then `image` holds their median, or `refusal` says why there is none."""

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
            self.image = np.median(np.stack(self._images), axis=0).astype(np.uint8)


class RunningBackground:
    """Background from the first images of a stream: good from the start where those show no contact.

    It is estimated anew after 1, 2, 4, ... images, up to `frames` of them, by the function `estimate`
    (images -> background).
    """

    def __init__(self, frames: int, estimate: Callable[[Sequence[np.ndarray]], np.ndarray]):
        self._frames, self._estimate = frames, estimate
        self._images: list[np.ndarray] = []
        self.image: np.ndarray | None = None
        self.change = 0.0

    @property
    def count(self) -> int:
        """Images it is made of; once complete the images themselves are dropped."""
        return self._frames if self._complete else len(self._images)

    @property
    def _complete(self) -> bool:
        return self.image is not None and not self._images

    def add(self, image: np.ndarray) -> None:
        """One more image (H, W, 3) uint8."""
        if self._complete:
            return
        self._images.append(image)
        n = len(self._images)
        if n == self._frames or n & (n - 1) == 0:
            self.image = self._estimate(self._images)
            self.change = largest_change(self._images)
        if n == self._frames:
            self._images = []
