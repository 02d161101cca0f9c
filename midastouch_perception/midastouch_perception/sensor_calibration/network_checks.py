"""What the depth network, which knows many other DIGITs, says of a calibration: the ball's diameter, and the gain.

Colours alone cannot tell the diameter: whatever slope they are said to mean, some light would make them. Light of which
most is like that of other DIGITs would not, and that is what the network, without calibration, has learned. It takes
every ball for a smaller one, by a factor that hardly depends on the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..sensor_model import SensorModel
from ..tdn.inference import load_tdn
from .calibration import SensorCalibration
from .response import height_slopes

FELT = 0.82
"""Radius that the shipped network feels, of the ball's: median over simulated sensors
(`midastouch_benchmark/fits/diameter.py`)."""
DOUBT = 1.4
"""Factor between the diameter given and the one felt. On simulated sensors one right diameter in eight is beyond it
(`midastouch_benchmark/fits/diameter.py`: 1.39 with seed 1, 1.38 with seed 2): as many have to say that theirs is
right."""
_CORE = 0.3  # of the deepest penetration: the rim is smeared
_FEWEST = 40  # px of it


def felt_radius(images: Sequence[np.ndarray], background: np.ndarray, sensor: SensorModel) -> float | None:
    """Radius [m] of the ball that the uncalibrated network feels in presses (320, 240, 3) uint8 RGB, their median; None
    if it feels none. sensor: full size."""
    tdn = load_tdn("fast", sensor)
    felt = [_curvature(tdn.predict(image, background), tdn.sensor.pixel_size) for image in images]
    bulging = [curvature for curvature in felt if curvature is not None and curvature > 0]
    return 1 / float(np.median(bulging)) if bulging else None


def diameter_doubt(felt: float | None, ball_diameter: float) -> str:
    """Why a ball that is felt with this radius [m] hardly has this diameter [m]; empty if it may."""
    if felt is None:
        return ""
    likely = 2 * felt / FELT
    factor = max(likely / ball_diameter, ball_diameter / likely)
    if factor <= DOUBT:
        return ""
    return f"the ball of {1e3 * ball_diameter:g} mm feels like one of about {1e3 * likely:.0f} mm"


def _curvature(felt: np.ndarray, pixel: float) -> float | None:
    """Mean curvature [1/m] of the core of a felt contact (H, W) m: how fast its slopes change with the position."""
    row, column = np.unravel_index(felt.argmax(), felt.shape)
    _, regions = cv2.connectedComponents((felt > _CORE * felt[row, column]).astype(np.uint8))
    core = cv2.erode((regions == regions[row, column]).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    if felt[row, column] <= 0 or core.sum() < _FEWEST:
        return None
    places = np.argwhere(core)[:, ::-1] * pixel
    places = places - places.mean(axis=0)
    slopes = height_slopes(felt, pixel)[core]
    return -float((slopes * places).sum() / (places**2).sum())


def felt_errors(
    images: Sequence[np.ndarray],
    penetrations: Sequence[np.ndarray | None],
    held_out: Sequence[SensorCalibration | None],
    background: np.ndarray,
    sensor: SensorModel,
) -> dict[str, float]:
    """felt_error_before, felt_error_after: root mean square error [m] of the felt depth in a touch's contact, median.

    Without calibration, and with the touch's own one of `held_out`, which has not seen it. images (320, 240, 3) uint8
    RGB; penetrations (H, W) m of what touches, None, as in held_out, for a touch that is not used; sensor: full size.
    """
    tdn, rows = load_tdn("fast", sensor), []
    for image, penetration, calibration in zip(images, penetrations, held_out, strict=True):
        if calibration is None:
            continue
        inside, row = penetration > 0, []
        for tdn.calibration in (None, calibration):
            error = (tdn.predict(image, background) - penetration)[inside]
            row.append(float(np.sqrt((error**2).mean())))
        rows.append(row)
    return dict(zip(("felt_error_before", "felt_error_after"), np.median(rows, axis=0).tolist(), strict=True))


def gain_doubt(figures: dict[str, float]) -> str:
    """In words, if touches that a calibration has not seen are felt no better with it (`felt_errors`); else empty."""
    before, after = (1e3 * figures[f"felt_error_{when}"] for when in ("before", "after"))
    if after < before:
        return ""
    return (
        f"depth in touches that it has not seen is felt no better with it, off by {after:.2f} mm, and without by "
        f"{before:.2f} mm; press more often and all over the gel, straight and without sliding, or go on without it"
    )
