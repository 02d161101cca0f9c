"""The sensor's no-contact image, from frames of a sequence when nobody captured one."""

from __future__ import annotations

import numpy as np

from ..errors import InputError

_STRIP = 20  # image rows at a time, so that memory stays small


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
