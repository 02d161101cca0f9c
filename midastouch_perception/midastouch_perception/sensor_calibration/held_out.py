"""The response of a sensor from touches of known shape, and what it is worth on touches that it has not seen.

Of a ball or of another object: from here on both go the same way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from midastouch_common.errors import InputError

from ..sensor_model import DIGIT_LAMPS, SensorModel
from .calibration import SensorCalibration, plain_slopes
from .response import NormalEquations, height_slopes, press_equations, well_inside

FEWEST = 5
_FOLDS = 5
_LEAST_STEEP = 0.05


def fitted(
    changes: Sequence[np.ndarray], penetrations: Sequence[np.ndarray | None], pixel: float, made: dict
) -> tuple[SensorCalibration, list[SensorCalibration | None]]:
    """The calibration from all touches, and for each touch the one from those of other folds (None if it is not used).

    changes (H, W, 3) grey levels; penetrations (H, W) m, negative beside the contact, None for a touch that is not
    used; pixel, m per pixel; made, what else a `SensorCalibration` says of itself.
    """
    used = [i for i, penetration in enumerate(penetrations) if penetration is not None]
    equations = {i: press_equations(changes[i], penetrations[i], pixel) for i in used}

    def solved(indices: list[int]) -> SensorCalibration:
        total = sum((equations[i] for i in indices), NormalEquations())
        return SensorCalibration(coefficients=total.solve(), presses=len(indices), **made)

    folds = [solved([i for k, i in enumerate(used) if k % _FOLDS != fold]) for fold in range(_FOLDS)]
    held_out: list[SensorCalibration | None] = [None] * len(changes)
    for k, i in enumerate(used):
        held_out[i] = folds[k % _FOLDS]
    return solved(used), held_out


def cross_validation(
    changes: Sequence[np.ndarray],
    penetrations: Sequence[np.ndarray | None],
    held_out: Sequence[SensorCalibration | None],
    pixel: float,
) -> dict[str, float]:
    """How well slopes are known in each used touch's contact, by a calibration that has not seen it (medians).

    explained_before, explained_after: share of the true slopes explained without and with calibration;
    steepness_before, steepness_after: how steep the slopes are, 1 in truth.
    """
    rows = []
    for change, penetration, calibration in zip(changes, penetrations, held_out, strict=True):
        if calibration is None:
            continue
        truth, inside = contact_slopes(penetration, pixel)
        row = []
        for slopes in (plain_slopes(change), calibration.response.slopes(change)):
            error, scale = (slopes - truth)[inside], float((truth[inside] ** 2).sum())
            steepness = float((slopes[inside] * truth[inside]).sum()) / scale
            row += [1 - float((error**2).sum()) / scale, max(steepness, _LEAST_STEEP)]
        rows.append(row)
    names = ("explained_before", "steepness_before", "explained_after", "steepness_after")
    return dict(zip(names, np.median(rows, axis=0).tolist(), strict=True))


def require_upright(changes: Sequence[np.ndarray], penetrations: Sequence[np.ndarray], sensor: SensorModel) -> None:
    """Raises InputError if the colours of a sensor with a DIGIT's lamps change by the slopes of what touches the other
    way round than on other DIGITs, across or along the finger. sensor: at the maps' resolution."""
    if sensor.lamps != DIGIT_LAMPS:
        return
    agreement = []
    for change, penetration in zip(changes, penetrations, strict=True):
        truth, inside = contact_slopes(penetration, sensor.pixel_size)
        agreement.append((plain_slopes(change)[inside] * truth[inside]).sum(axis=0))
    if np.median(agreement, axis=0).min() < 0:
        raise InputError(
            "the colours answer to slopes the other way round than on other DIGITs: the images are turned or mirrored, "
            "have red and blue swapped, or the no-contact image shows a contact; check the driver's rotation and "
            "encoding, and capture the no-contact image anew"
        )


def contact_slopes(penetration: np.ndarray, pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (H, W, 2) of what touches with a penetration (H, W) m, and where (H, W) bool the gel has them."""
    return height_slopes(np.maximum(penetration, 0), pixel), well_inside(penetration)
