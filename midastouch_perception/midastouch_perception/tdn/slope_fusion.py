"""Depth from slopes: those that a calibration gives for the colours, joined with those of the depth network.

A slope has no unit. Depth is the integral of slopes over pixels of the sensor's own size, so the same image at twice
the pixels per metre is half as deep. The network gives the region of contact. There we find the height whose slopes are
nearest to the joined ones (Poisson's equation) and which is 0 some pixels outside of the contact. Integrated also over
the gel that sinks in around the contact, slopes give the depth below the untouched gel.
"""

from __future__ import annotations

import cv2
import numpy as np

import midastouch_kernels as kernels

from ..sensor_calibration.calibration import Fusion
from ..sensor_calibration.response import height_slopes
from .inputs import coarse

_BESIDE = np.ones((3, 3), np.uint8)
_SUNK_IN = 2e-3  # m from a contact, beyond which a gel of some millimetres is undeformed
_LEAST = np.float32(1e-6)  # m; the contact stays where the network finds it, whatever its slopes add up to
_COARSE = 2  # px of the map per coarse pixel, along each side; enough for a single number


def joined_depth(slopes: np.ndarray, penetration: np.ndarray, pixel: float, fusion: Fusion) -> np.ndarray:
    """Return the penetration (H, W) float32 m of a contact.

    slopes (H, W, 2) by the calibration, to the right and down; penetration (H, W) m by the network, 0 outside of the
    contact; pixel, m per pixel; fusion, of the calibration.
    """
    touched = penetration > 0
    if not touched.any():
        return np.zeros(touched.shape, np.float32)
    weight, growth = fusion
    joined = (1 - weight) * slopes + weight * height_slopes(penetration, pixel)
    region = cv2.dilate(touched.astype(np.uint8), _BESIDE, iterations=growth)
    height = kernels.integrate_slopes(np.ascontiguousarray(joined, np.float32), region, pixel)
    return np.where(touched, np.maximum(height, _LEAST), np.maximum(height, 0))


def depth_below_gel(slopes: np.ndarray, penetration: np.ndarray, pixel: float) -> float:
    """Return the depth [m] of a contact's deepest point below the untouched gel, from the slopes around the contact.

    slopes (H, W, 2) by the calibration, to the right and down; penetration (H, W) m of the contact, 0 outside; pixel, m
    per pixel.
    """
    touched = (penetration > 0).astype(np.uint8)
    if not touched.any():
        return 0.0
    # slopes of the penetration end at its outline; those of the gel continue beyond it
    inner = cv2.erode(touched, _BESIDE) > 0
    everywhere = np.where(inner[..., None], height_slopes(penetration, pixel), slopes)
    away = cv2.distanceTransform(1 - touched, cv2.DIST_L2, 5)[::_COARSE, ::_COARSE] * pixel
    region = (away < _SUNK_IN).astype(np.uint8)
    sunk = kernels.integrate_slopes(
        np.ascontiguousarray(coarse(everywhere, _COARSE), np.float32), region, _COARSE * pixel
    )
    return float(max(sunk.max(), penetration.max()))
