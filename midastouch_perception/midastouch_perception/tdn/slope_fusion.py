"""Depth from slopes: those that a calibration sees in the colours, joined with those of the depth network.

A slope has no unit. Depth is what slopes add up to over pixels of the sensor's own size, so the same image seen at
twice the pixels per metre is half as deep. The network says where something touches; there the height is found whose
slopes are nearest to the joined ones (Poisson's equation), and it ends at nothing a pixel beside the contact. Over the
gel that sinks in around it, too, they add up to the depth below the untouched gel.
"""

from __future__ import annotations

import cv2
import numpy as np

import midastouch_kernels as kernels

from ..sensor_calibration.response import height_slopes

NETWORK_WEIGHT = 0.51
"""Of the network's slopes in the joined ones: that with the least variance on measured sensors and training objects
(`midastouch_benchmark/fits/slope_weight.py`)."""
_BESIDE = np.ones((3, 3), np.uint8)
_SUNK_IN = 2e-3  # m beside a contact where gel of some millimetres is untouched again
_COARSE = 2  # px of the map a side, to one of those that a single number needs


def joined_depth(slopes: np.ndarray, penetration: np.ndarray, pixel: float) -> np.ndarray:
    """Penetration (H, W) float32 m of a contact.

    slopes (H, W, 2) by the calibration, to the right and down; penetration (H, W) m by the network, 0 where nothing
    touches; pixel, m per pixel.
    """
    touched = penetration > 0
    if not touched.any():
        return np.zeros(touched.shape, np.float32)
    joined = (1 - NETWORK_WEIGHT) * slopes + NETWORK_WEIGHT * height_slopes(penetration, pixel)
    region = cv2.dilate(touched.astype(np.uint8), _BESIDE)
    height = kernels.integrate_slopes(np.ascontiguousarray(joined, np.float32), region, pixel)
    return np.maximum(height, 0)


def depth_below_gel(slopes: np.ndarray, penetration: np.ndarray, pixel: float) -> float:
    """Depth [m] of a contact's deepest point below the untouched gel, which the slopes beside the contact lead to.

    slopes (H, W, 2) by the calibration, to the right and down; penetration (H, W) m of the contact, 0 beside it; pixel,
    m per pixel.
    """
    touched = (penetration > 0).astype(np.uint8)
    if not touched.any():
        return 0.0
    # at the outline of the penetration its slopes end, those of the gel go on
    inner = cv2.erode(touched, _BESIDE) > 0
    everywhere = np.where(inner[..., None], height_slopes(penetration, pixel), slopes)
    height, width = touched.shape
    coarse = cv2.resize(everywhere, (width // _COARSE, height // _COARSE), interpolation=cv2.INTER_AREA)
    away = cv2.distanceTransform(1 - touched, cv2.DIST_L2, 5)[::_COARSE, ::_COARSE] * pixel
    region = (away < _SUNK_IN).astype(np.uint8)
    sunk = kernels.integrate_slopes(np.ascontiguousarray(coarse, np.float32), region, _COARSE * pixel)
    return float(max(sunk.max(), penetration.max()))
