"""The gel's surface around a contact: it does not end where the touching ends."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

_STEEPEST = 0.7  # slope with which the gel leaves an object


def sunk_in(penetration: np.ndarray, pixel: float, reach: float, share: float) -> np.ndarray:
    """Height (H, W) float32 m of a gel that a contact draws in around itself, as a membrane does.

    Where an object touches, the gel has its shape; beside it the slope at the outline dies away over `reach` m. So the
    gel moves further than the contact goes, and over a larger area.

    Args: penetration (H, W) m, of the contact; pixel, m per pixel; share (0 ... 1) of the outline's slope with which
    the gel leaves the object: 0 for one that ends at the outline, 1 for one without an edge there.
    """
    touched = (penetration > 0).astype(np.uint8)
    rim = (touched > 0) & (cv2.erode(touched, np.ones((3, 3), np.uint8)) == 0)
    if touched.all() or not rim.any():
        return penetration
    slope_x, slope_y = cv2.Sobel(penetration, cv2.CV_32F, 1, 0), cv2.Sobel(penetration, cv2.CV_32F, 0, 1)
    steep = float(np.median(np.hypot(slope_x[rim], slope_y[rim]))) / (8 * pixel)
    depth = share * reach * min(steep, _STEEPEST)
    distance = cv2.distanceTransform(1 - touched, cv2.DIST_L2, 5) * np.float32(pixel)
    return penetration + np.float32(depth) * np.exp(-distance / np.float32(reach))


@dataclasses.dataclass(frozen=True)
class GelShape:
    """How the gel takes the shape of what is pressed in: reach [m] and share as for `sunk_in`, blur [m]."""

    reach: float
    share: float
    blur: float

    def height(self, penetration: np.ndarray, pixel: float) -> np.ndarray:
        """Height (H, W) float32 m of the gel over its rest, for a penetration map (H, W) m, m per pixel."""
        return cv2.GaussianBlur(sunk_in(penetration, pixel, self.reach, self.share), (0, 0), self.blur / pixel)
