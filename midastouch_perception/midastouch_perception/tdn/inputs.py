"""Inputs of the depth network: the difference from the no-contact image, free of drift, and the sensor's geometry.

A sensor's light changes slowly as LEDs warm up and gel settles, so a no-contact image becomes outdated.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError

from ..sensor_calibration.response import position_terms
from ..sensor_model import SensorModel

_GREY_LEVELS = 32.0
RELATIVE_LEVEL = 100.0  # grey levels of the background to which a relative difference is scaled
DARKEST = 30.0  # grey levels; division by a darker background would amplify noise
_GAIN_STEP = 4  # px; every fourth pixel is enough to measure the gain
_LEAST_GAIN = 0.1
_METRES = 0.01
_SAG = 0.003
DRIFT_GRID = (5, 4)
"""Rows, columns of the field of drift: so coarse that the bright and dark sides of a contact cancel."""
LARGEST_DRIFT = 15.0
"""Grey levels. A larger difference means another sensor or another light, which the fit check reports."""
_DRIFT_RATE = 0.1  # per frame without contact
_JUMP = LARGEST_DRIFT / 3  # grey levels; light changes by less between frames, so the clip limits the effect of a touch
_BLOCK = 8  # px
BLOCKS = (20, 15)  # rows, columns of the blocks over which checks average images
_DRIFT_ROUNDS = 6
_QUIET_FRACTION = 0.6  # of the image is free of contact and shadow


def check_image(image: np.ndarray, sensor: SensorModel, what: str) -> np.ndarray:
    """Return `image` if it is (H, W, 3) uint8 of the sensor's size; otherwise InputError with `what` and the fix."""
    shape = (sensor.height, sensor.width, 3)
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        raise InputError(f"{what}: {kind} image, need uint8; convert it to 8 bit RGB")
    if image.shape != shape:
        raise InputError(f"{what}: image of shape {image.shape}, need {shape}; use the DIGIT's portrait QVGA image")
    return image


def reduce_image(image: np.ndarray) -> np.ndarray:
    """Return a camera image (320, 240, 3) uint8 as (160, 120, 3) float32 grey levels, each pixel the mean of four."""
    return kernels.halve_image(np.ascontiguousarray(image))


def block_means(image: np.ndarray) -> np.ndarray:
    """Return the means (20, 15, ...) over the `BLOCKS` of an image (H, W, ...) float32."""
    return cv2.resize(image, BLOCKS[::-1], interpolation=cv2.INTER_AREA)


def coarse(image: np.ndarray, side: int) -> np.ndarray:
    """Return the means (H / side, W / side, ...) of an image (H, W, ...) over squares of `side` pixels."""
    height, width = image.shape[:2]
    return cv2.resize(image, (width // side, height // side), interpolation=cv2.INTER_AREA)


class ContactLight:
    """Change of images by contact, for one no-contact image `background` (H, W, 3) float32 grey levels.

    light: as `SensorModel.light`. Exposure and lamps change a whole colour from frame to frame. As most of the image is
    untouched, the median ratio of each colour to the background measures that, and it is removed. For relative light,
    the rest is divided by the background: the fraction by which sloping gel becomes brighter is nearly the same for all
    sensors and over the image, while grey levels differ several times.
    """

    def __init__(self, background: np.ndarray, light: str):
        self._background = np.ascontiguousarray(background, np.float32)
        self._sparse = 1 / np.maximum(self._background[::_GAIN_STEP, ::_GAIN_STEP], 1)
        self._unit = RELATIVE_LEVEL / np.maximum(background, DARKEST) if light == "relative" else None

    def difference(self, image: np.ndarray) -> np.ndarray:
        """Return the change (H, W, 3) float32 by contact, in grey levels, of an image (H, W, 3) float32 grey levels.

        For relative light it is scaled to a background of 100 grey levels.
        """
        image = np.ascontiguousarray(image, np.float32)
        change = kernels.change_beside_gain(image, self._background, self._sparse, _GAIN_STEP, _LEAST_GAIN)
        return change if self._unit is None else change * self._unit


def difference_input(difference: np.ndarray) -> np.ndarray:
    """Return difference images (N, H, W, 3), grey levels, as network input (N, 3, H, W) float32."""
    return kernels.planes(np.ascontiguousarray(difference, np.float32), 1 / _GREY_LEVELS)


def geometry_input(sensor: SensorModel) -> np.ndarray:
    """Return the metric position of each pixel on the gel and the gel's sag there, scaled: (3, H, W) float32.

    With this input one set of weights serves sensors of different scale and dome.
    """
    tangent_x, tangent_y = sensor.rays
    depth = sensor.gel_depth
    sag = (sensor.gel_distance - depth) / _SAG
    return np.stack([tangent_x * depth / _METRES, tangent_y * depth / _METRES, sag]).astype(np.float32)


class LightDrift:
    """Drift of the light since the no-contact image, learned from frames without contact and subtracted from others.

    It is a smooth field: cubic between the nodes of a coarse grid, fitted by least squares.
    """

    def __init__(self) -> None:
        self._nodes = np.zeros((*DRIFT_GRID, 3), np.float32)
        self._field: np.ndarray | None = None  # (H, W, 3) between the nodes, None before the first frame

    def learn(self, difference: np.ndarray) -> None:
        """Learn from the difference (H, W, 3), grey levels, of a frame without contact from the no-contact image."""
        new = np.clip(self.correct(difference), -_JUMP, _JUMP)
        rows, columns = (_fit(length, nodes) for length, nodes in zip(new.shape, DRIFT_GRID, strict=False))
        off = np.einsum("rwc,nw->rnc", np.tensordot(rows, new, 1), columns)
        self._nodes = np.clip(self._nodes + _DRIFT_RATE * off, -LARGEST_DRIFT, LARGEST_DRIFT)
        self._field = cv2.resize(self._nodes, difference.shape[1::-1], interpolation=cv2.INTER_CUBIC)

    def correct(self, difference: np.ndarray) -> np.ndarray:
        """Return the difference (H, W, 3) from the no-contact image without the drift."""
        return difference if self._field is None else difference - self._field


@cache
def _fit(length: int, nodes: int) -> np.ndarray:
    """Return the matrix (nodes, length) from values along an axis to the best-fitting nodes of cubic interpolation."""
    grown: np.ndarray = cv2.resize(np.eye(nodes, dtype=np.float32), (nodes, length), interpolation=cv2.INTER_CUBIC)
    return np.linalg.pinv(grown)


def without_drift(change: np.ndarray) -> np.ndarray:
    """Return a change (H, W, 3) without its slowly varying part, caused by lamps that have warmed since the no-contact
    image: a quadratic in the position, fitted to block means by least squares, repeatedly, each time to the quieter
    ones."""
    blocks = coarse(change, _BLOCK)
    positions = position_terms(*blocks.shape[:2]).reshape(-1, 6)
    blocks = blocks.reshape(-1, 3)
    kept = np.ones(len(blocks), bool)
    for _ in range(_DRIFT_ROUNDS):
        factors = np.linalg.lstsq(positions[kept], blocks[kept], rcond=None)[0]
        off = np.abs(blocks - positions @ factors).max(axis=1)
        kept = off <= max(np.quantile(off, _QUIET_FRACTION), 1e-3)
    return change - (position_terms(*change.shape[:2]) @ factors).astype(np.float32)
