"""Is a sensor read better with its calibration than without, by the depth network, in touches that it has not seen?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..sensor_model import SensorModel
from ..tdn.inference import load_tdn
from .calibration import SensorCalibration


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
