"""Checks of a calibration by the depth network, which knows many other DIGITs: the ball's diameter, and the gain.

Colours alone do not show the diameter: for any slope, there is some light that makes them. Light that is mostly like
that of other DIGITs is not arbitrary, and the network, without calibration, has learned that light. It takes every ball
for a smaller one, by a factor that hardly depends on the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..sensor_model import SensorModel
from ..tdn.inference import load_tdn
from .calibration import SensorCalibration
from .response import height_slopes

RADIUS_RATIO = 0.82
"""Radius that the shipped network measures, relative to the ball's: median over simulated sensors
(`midastouch_benchmark/fits/diameter.py`)."""
MOST_DIAMETER_FACTOR = 1.4
"""Largest factor between the diameters given and measured. On simulated sensors one right diameter in eight exceeds it
(`midastouch_benchmark/fits/diameter.py`: 1.39 with seed 1, 1.38 with seed 2); such users must confirm theirs."""
_CORE_DEPTH = 0.3  # of the deepest penetration; the rim below is smeared
_FEWEST_CORE_PIXELS = 40


def measured_radius(images: Sequence[np.ndarray], background: np.ndarray, sensor: SensorModel) -> float | None:
    """Return the median radius [m] of the ball that the network measures in presses (320, 240, 3) uint8 RGB, without a
    calibration of the sensor's own; None if it measures none. sensor: full size."""
    tdn = load_tdn("fast", sensor)
    measured = [_curvature(tdn.predict(image, background), tdn.sensor.pixel_size) for image in images]
    bulging = [curvature for curvature in measured if curvature is not None and curvature > 0]
    return 1 / float(np.median(bulging)) if bulging else None


def diameter_doubt(radius: float | None, ball_diameter: float, sensor: SensorModel) -> str:
    """Return the reason why a ball of this measured radius [m] can hardly have this diameter [m]; empty if it can.

    With unknown lamps, whose colours have no known meaning, it always can.
    """
    if radius is None or not sensor.lamps:
        return ""
    likely = 2 * radius / (1.0 if SensorCalibration.default(sensor) else RADIUS_RATIO)
    factor = max(likely / ball_diameter, ball_diameter / likely)
    if factor <= MOST_DIAMETER_FACTOR:
        return ""
    return f"the ball of {1e3 * ball_diameter:g} mm measures like one of about {1e3 * likely:.0f} mm"


def _curvature(penetration: np.ndarray, pixel: float) -> float | None:
    """Return the mean curvature [1/m] of the core of a contact (H, W) m: the change of its slopes with the position."""
    row, column = np.unravel_index(penetration.argmax(), penetration.shape)
    _, regions = cv2.connectedComponents((penetration > _CORE_DEPTH * penetration[row, column]).astype(np.uint8))
    core = cv2.erode((regions == regions[row, column]).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    if penetration[row, column] <= 0 or core.sum() < _FEWEST_CORE_PIXELS:
        return None
    positions = np.argwhere(core)[:, ::-1] * pixel
    positions = positions - positions.mean(axis=0)
    slopes = height_slopes(penetration, pixel)[core]
    return -float((slopes * positions).sum() / (positions**2).sum())


def depth_errors(
    images: Sequence[np.ndarray],
    penetrations: Sequence[np.ndarray | None],
    held_out: Sequence[SensorCalibration | None],
    background: np.ndarray,
    sensor: SensorModel,
) -> dict[str, float]:
    """Return errors of the depth measured in touches, medians: felt_error_before, felt_error_after, root mean square
    error [m] in the contact; curvature_before, curvature_after, curvature of its core relative to the true one.

    "Before" is without a calibration of the sensor's own, "after" with the touch's one of `held_out`. images
    (320, 240, 3) uint8 RGB; penetrations (H, W) m of the object, None, as in held_out, for a touch that is not used;
    sensor: full size.
    """
    tdn, rows, curvatures = load_tdn("fast", sensor), [], []
    for image, penetration, calibration in zip(images, penetrations, held_out, strict=True):
        if calibration is None:
            continue
        inside, row = penetration > 0, []
        true, curved = _curvature(np.maximum(penetration, 0), tdn.sensor.pixel_size), []
        for tdn.calibration in (None, calibration):
            measured = tdn.predict(image, background)
            row.append(float(np.sqrt(((measured - penetration)[inside] ** 2).mean())))
            core = _curvature(measured, tdn.sensor.pixel_size)
            curved.append(np.nan if core is None or true is None else core / true)
        rows.append(row)
        curvatures.append(curved)
    known = [row for row in curvatures if np.isfinite(row).all()] or [[np.nan, np.nan]]
    values = *np.median(rows, axis=0).tolist(), *np.median(known, axis=0).tolist()
    return dict(
        zip(("felt_error_before", "felt_error_after", "curvature_before", "curvature_after"), values, strict=True)
    )


def gain_doubt(figures: dict[str, float]) -> str:
    """Return a message if a calibration does not improve the depth in touches that it was not fitted to
    (`depth_errors`); otherwise empty."""
    before, after = (1e3 * figures[f"felt_error_{when}"] for when in ("before", "after"))
    if after < before:
        return ""
    return (
        f"depth in touches that it has not seen is measured no better with it, off by {after:.3f} mm, and without by "
        f"{before:.3f} mm; press more often and all over the gel, straight and without sliding, or go on without it"
    )
