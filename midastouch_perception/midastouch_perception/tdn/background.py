"""The sensor's no-contact image: from frames of a sequence when nobody captured one, and whether it is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from midastouch_common.errors import InputError

from ..contact import ContactDetector
from .drift import without_drift
from .fit_check import EXPLAINED_LIMIT, QUIET_LIMIT, explained_share, quietest_tenth

if TYPE_CHECKING:
    from .depth_net import DepthNet

_STRIP = 20  # image rows at a time, so that memory stays small
_BLOCK = 16  # px; noise averages out over a block
_SAME = 4.0  # grey levels between block means that still are the same surface
_CHANGED = 8.0  # grey levels
_SMOOTHED = 2.0  # px of half the image's resolution
_CLEARLY = 1.02  # times as rough
MOST_DOUBTFUL = 0.1
"""Share of the image: with more of it doubtful an estimate shows contacts."""
_MAJORITY = 1 / 3  # of the frames that show a place untouched, or its median is not trusted


def estimate_background(images: list[np.ndarray]) -> np.ndarray:
    """No-contact image (320, 240, 3) uint8 as the per-pixel median of images (320, 240, 3) uint8 of one sensor.

    While the sensor slides, each pixel is untouched most of the time. Raises InputError without images or with
    images of different size.
    """
    if not images:
        raise InputError("background: no frames to estimate it from; give a no-contact image")
    if len({image.shape for image in images}) != 1:
        raise InputError("background: frames of different size; use those of one sensor only")
    out = np.empty_like(images[0])
    for row in range(0, out.shape[0], _STRIP):
        out[row : row + _STRIP] = np.median([image[row : row + _STRIP] for image in images], axis=0)
    return out


def doubtful_share(images: list[np.ndarray], background: np.ndarray) -> float:
    """Share of the image in which `background`, estimated from `images`, is that of few of them only.

    There the sensor was touched too often, and the median shows contacts. A contact that never ends cannot be told.
    """
    small = [_block_means(image) for image in (*images, background)]
    same = np.abs(np.stack(small[:-1]) - small[-1]).max(axis=3) < _SAME
    return float((same.mean(axis=0) < _MAJORITY).mean())


def shows_contact(tdn: DepthNet, candidate: np.ndarray, present: np.ndarray) -> bool:
    """Whether an image is that of a sensor whose no-contact image is `present`, with something pressed onto it.

    Both (320, 240, 3) uint8 RGB. Not so if it is the other way round, `present` showing the contact: untouched gel is
    the smoother of the two. Nor if the images differ everywhere, as those of two sensors do, or slowly over the image,
    as under lamps that have warmed.
    """
    difference = tdn.difference(candidate, present)
    if quietest_tenth(difference) > QUIET_LIMIT:
        return False
    difference = without_drift(difference)
    felt = tdn.predict(candidate, present, difference)
    forward = explained_share(difference, felt, tdn.sensor.pixel_size)
    if (
        forward is None
        or forward < EXPLAINED_LIMIT[tdn.sensor.light]
        or not ContactDetector(tdn.sensor).update(felt).in_contact
    ):
        return False
    touched = np.abs(difference).max(axis=2) > _CHANGED
    return _roughness(candidate, touched) > _CLEARLY * _roughness(present, touched)


def _roughness(image: np.ndarray, where: np.ndarray) -> float:
    """Mean curvature of an image's brightness over the pixels (160, 120) bool, noise smoothed away."""
    small = cv2.resize(image, where.shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)
    curvature = np.abs(cv2.Laplacian(cv2.GaussianBlur(small, (0, 0), _SMOOTHED), cv2.CV_32F)).sum(axis=2)
    return float(curvature[where].mean())


def _block_means(image: np.ndarray) -> np.ndarray:
    size = (image.shape[1] // _BLOCK, image.shape[0] // _BLOCK)
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
