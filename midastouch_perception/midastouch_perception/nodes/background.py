"""The sensor's no-contact image: read from files, captured on request, or estimated while images arrive.

ROS-free: the node feeds images in and asks for the current background.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ..errors import InputError
from ..tdn.background import doubtful_share, estimate_background

_BLOCK = 16
_MOST_FILES = 200
_MOST_DOUBT = 0.1  # share of the image


def read_background(path: str | Path, height: int, width: int) -> np.ndarray:
    """RGB image (height, width, 3) uint8 from an image file, or estimated from a folder of a sensor's images.

    Raises InputError: no such path, no images in it, not an image, another size, or images that show contacts at the
    same place too often to tell what is behind them.
    """
    path = Path(path)
    if not path.is_dir():
        return _read_image(path, height, width)
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in (".png", ".jpg", ".jpeg"))
    if not files:
        raise InputError(f"{path}: no PNG or JPEG images in this folder to estimate a background from")
    chosen = files[:: -(-len(files) // _MOST_FILES)]
    images = [_read_image(file, height, width) for file in chosen]
    background = estimate_background(images)
    doubt = doubtful_share(images, background)
    if doubt > _MOST_DOUBT:
        raise InputError(
            f"{path}: {100 * doubt:.0f} % of the image is touched in most of these images; "
            "give images without contact, or a slide with longer pauses"
        )
    return background


def _read_image(path: Path, height: int, width: int) -> np.ndarray:
    if not path.is_file():
        raise InputError(f"{path}: no such background image; leave the parameter empty to estimate one")
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: not an image; use PNG or JPEG")
    if image.shape[:2] != (height, width):
        raise InputError(f"{path}: {image.shape[1]} x {image.shape[0]} pixels, the sensor model has {width} x {height}")
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
