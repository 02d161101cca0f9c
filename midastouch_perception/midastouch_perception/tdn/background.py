"""No-contact image of a sensor: capture on request, estimate from images, and a check that it shows no touch.

A touch in the no-contact image is part of every difference, wherever the finger is, and hides contacts there. The
median of images that are touched at different positions is the untouched gel; the no-contact image must not look like
that gel with an object pressed onto it.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from midastouch_common.errors import InputError

from ..contact import ContactDetector
from .depth_net import DepthNet
from .fit_check import EXPLAINED_LIMIT, QUIET_LIMIT, explained_fraction, quietest_tenth
from .inputs import coarse, without_drift

_STRIP = 20  # image rows at a time, so that memory stays small
_BLOCK = 16  # px; noise averages out over a block
_SAME_SURFACE = 4.0  # grey levels between block means, up to which they show the same surface
_LEAST_CHANGE = 8.0  # grey levels: a pixel that differs more is touched
_SMOOTHING = 2.0  # px of half the image's resolution
_LEAST_ROUGHNESS_RATIO = 1.02  # of an image with a contact to the untouched gel
MOST_DOUBTFUL = 0.1
"""Largest doubtful fraction of the image; beyond it, an estimate shows contacts."""
_LEAST_FREE_FRACTION = 1 / 3  # of the frames that must show a pixel as in its median for it to be trusted


def estimate_background(images: list[np.ndarray]) -> np.ndarray:
    """Estimate the no-contact image as per-pixel median.

    While the sensor slides, each pixel is untouched most of the time.

    Parameters
    ----------
    images : images (320, 240, 3) uint8 of one sensor

    Returns
    -------
    (320, 240, 3) uint8

    Raises
    ------
    InputError
        There are no images, or their sizes differ.
    """
    if not images:
        raise InputError("background: no frames to estimate it from; give a no-contact image")
    if len({image.shape for image in images}) != 1:
        raise InputError("background: frames of different size; use those of one sensor only")
    out = np.empty_like(images[0])
    for row in range(0, out.shape[0], _STRIP):
        out[row : row + _STRIP] = np.median([image[row : row + _STRIP] for image in images], axis=0)
    return out


def doubtful_fraction(images: list[np.ndarray], background: np.ndarray) -> float:
    """Return the fraction (0 ... 1) of the image in which `background`, estimated from `images`, equals few of them.

    There the sensor was touched too often, and the median shows contacts. A contact in all images is not detected.
    """
    small = [coarse(image, _BLOCK).astype(np.float32) for image in (*images, background)]
    same = np.abs(np.stack(small[:-1]) - small[-1]).max(axis=3) < _SAME_SURFACE
    return float((same.mean(axis=0) < _LEAST_FREE_FRACTION).mean())


def shows_contact(tdn: DepthNet, candidate: np.ndarray, present: np.ndarray) -> bool:
    """Return whether `candidate` shows the sensor of the no-contact image `present` with an object pressed onto it.

    Both are (320, 240, 3) uint8 RGB. False if `present` is the image with the contact (untouched gel is smoother), if
    the images differ everywhere, as those of two sensors do, or if their difference varies slowly over the image, as
    under lamps that have warmed.
    """
    difference = tdn.difference(candidate, present)
    if quietest_tenth(difference) > QUIET_LIMIT:
        return False
    difference = without_drift(difference)
    penetration = tdn.predict(candidate, present, difference)
    explained = explained_fraction(difference, penetration, tdn.sensor.pixel_size)
    if (
        explained is None
        or explained < EXPLAINED_LIMIT[tdn.sensor.light]
        or not ContactDetector(tdn.sensor).update(penetration).in_contact
    ):
        return False
    touched = np.abs(difference).max(axis=2) > _LEAST_CHANGE
    return _roughness(candidate, touched) > _LEAST_ROUGHNESS_RATIO * _roughness(present, touched)


def _roughness(image: np.ndarray, where: np.ndarray) -> float:
    """Return the mean curvature of an image's brightness over pixels (160, 120) bool, with noise smoothed away."""
    small = cv2.resize(image, where.shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)
    curvature = np.abs(cv2.Laplacian(cv2.GaussianBlur(small, (0, 0), _SMOOTHING), cv2.CV_32F)).sum(axis=2)
    return float(curvature[where].mean())


def largest_change(images: Sequence[np.ndarray]) -> float:
    """Return the largest change [grey levels] of any 16 x 16 block's mean against the first image.

    Block means suppress pixel noise (a few grey levels) but still show a small contact that moves.
    """
    means = np.stack([coarse(image, _BLOCK).astype(np.float32) for image in images])
    return float(np.abs(means - means[0]).max())


class BackgroundCapture:
    """Capture of a background: at its end, `image` is the background, or `refusal` has the reason; `count` is the
    number of images that have come.

    Parameters
    ----------
    frames
        Number of images.
    still_threshold : [grey levels]
        Largest change of a 16 x 16 block between the images.
    """

    def __init__(self, frames: int, still_threshold: float):
        self.frames, self._still_threshold = frames, still_threshold
        self._images: list[np.ndarray] = []
        self.image: np.ndarray | None = None
        self.refusal = ""

    @property
    def count(self) -> int:
        return len(self._images)

    @property
    def done(self) -> bool:
        """True once enough images have come."""
        return self.count >= self.frames

    def add(self, image: np.ndarray) -> None:
        """Take one more image (H, W, 3) uint8."""
        self._images.append(image)
        if not self.done:
            return
        change = largest_change(self._images)
        if change > self._still_threshold:
            self.refusal = (
                f"the image is not still: it changed by {change:.1f} grey levels over {self.frames} frames "
                f"(limit {self._still_threshold:.1f}); lift the finger off, hold it still and try again"
            )
        else:
            self.image = estimate_background(self._images)


class RunningBackground:
    """Background from the first images of a stream; it is good from the start if those show no contact.

    It is estimated again after 1, 2, 4, ... images, up to `frames` of them.
    """

    def __init__(self, frames: int):
        self._frames = frames
        self._images: list[np.ndarray] = []
        self.count = 0
        self.image: np.ndarray | None = None
        self.change = 0.0

    def add(self, image: np.ndarray) -> None:
        """Take one more image (H, W, 3) uint8."""
        if self.count == self._frames:
            return
        self._images.append(image)
        self.count += 1
        if self.count == self._frames or self.count & (self.count - 1) == 0:
            self.image = estimate_background(self._images)
            self.change = largest_change(self._images)
        if self.count == self._frames:
            self._images.clear()


class TouchedBackground:
    """Check that a sensor's no-contact image shows no touch, by the images that differ from it.

    Attribute: problem and its fix if the no-contact image shows a touch; otherwise empty.

    Parameters
    ----------
    tdn
    every
        Number of images out of which one is kept, doubled after each window, because a no-contact image does not change
        by itself.
    window
        Number of kept images that are judged together, first when a third have come.
    """

    def __init__(self, tdn: DepthNet, every: int = 5, window: int = 15):
        self._tdn, self._every, self._window = tdn, every, window
        self._step = max(1, window // 3)
        self.reset()

    def reset(self) -> None:
        """Forget all images, because the no-contact image has changed."""
        self._start(None)

    def observe(self, image: np.ndarray, background: np.ndarray) -> None:
        """Take an image; do not write into it later.

        Parameters
        ----------
        image, background : (320, 240, 3) uint8 RGB
            The image, and the no-contact image in use.
        """
        if background is not self._background:
            self._start(background)
        self._frames += 1
        if (self._frames - 1) % self._stride:
            return
        self._images.append(image)
        # judged with a third of the window, two thirds, and all of it
        if len(self._images) % self._step == 0:
            self._judge()
        if len(self._images) >= self._window:
            self._images.clear()
            self._stride *= 2

    def _start(self, background: np.ndarray | None) -> None:
        self._background, self._frames, self._stride = background, 0, self._every
        self._images: list[np.ndarray] = []
        self.problem = ""

    def _judge(self) -> None:
        self.problem = ""
        if shows_contact(self._tdn, self._background, estimate_background(self._images)):
            self.problem = (
                "the no-contact image shows a touch that the images do not have; lift the finger and call "
                "capture_background"
            )
