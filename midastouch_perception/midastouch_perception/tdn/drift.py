"""Slow change of a sensor's light: LEDs warm up, gel settles, and the no-contact image ages."""

from __future__ import annotations

import cv2
import numpy as np

from ..sensor_calibration.response import place_terms

_GRID = (5, 4)  # rows, columns: far coarser than a contact, whose bright and dark sides cancel
_RATE = 0.1  # per frame without contact
_BLOCK = 8  # px
_ROUNDS = 6
_QUIET = 0.6  # of the image is free of contact and shadow
_LARGEST = 15.0  # grey levels: what differs more is another sensor or another light, which the fit check tells


class LightDrift:
    """What the no-contact image has become, learned while nothing is touched and taken off while something is."""

    def __init__(self) -> None:
        self._offset = np.zeros((*_GRID, 3), np.float32)

    def learn(self, difference: np.ndarray) -> None:
        """One frame without contact: its difference (H, W, 3), grey levels, to the stored no-contact image."""
        now = cv2.resize(difference, _GRID[::-1], interpolation=cv2.INTER_AREA)
        self._offset += _RATE * (np.clip(now, -_LARGEST, _LARGEST) - self._offset)

    def correct(self, difference: np.ndarray) -> np.ndarray:
        """Difference (H, W, 3) to the no-contact image of today."""
        if not self._offset.any():
            return difference
        return difference - cv2.resize(self._offset, difference.shape[1::-1], interpolation=cv2.INTER_LINEAR)


def without_drift(change: np.ndarray) -> np.ndarray:
    """A change (H, W, 3) less what varies slowly over the image: lamps that have warmed since the no-contact image.

    A quadratic in the position, fitted to block means by least squares over and over, each time to the quieter ones.
    """
    height, width = change.shape[:2]
    blocks = cv2.resize(change, (width // _BLOCK, height // _BLOCK), interpolation=cv2.INTER_AREA)
    places = place_terms(*blocks.shape[:2]).reshape(-1, 6)
    blocks = blocks.reshape(-1, 3)
    kept = np.ones(len(blocks), bool)
    for _ in range(_ROUNDS):
        factors = np.linalg.lstsq(places[kept], blocks[kept], rcond=None)[0]
        off = np.abs(blocks - places @ factors).max(axis=1)
        kept = off <= max(np.quantile(off, _QUIET), 1e-3)
    return change - (place_terms(height, width) @ factors).astype(np.float32)
