"""Checks of a calibration by the depth network, which knows many other DIGITs: the ball's diameter and shape, the gain.

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
CORE = 0.5
"""Fraction of the deepest penetration above which a known ball's radius is measured; the rim below is smeared."""
_WIDE_CORE = 0.3  # the same for a ball that is not known, with less noise
_MOST_RADIUS_OFF = 0.1  # fraction by which the radius of the ball may be missed
_FEWEST_CORE_PIXELS = 40
_ROUND = -0.03  # logarithm of width over height of a ball's contacts for the network; median of 100 imaginary sensors
_MOST_STRETCH = 0.1  # the same, beyond that of round contacts, which none of these sensors exceeded
_OF_MEDIAN = 1.25  # standard error of a median over that of a mean


def measured_maps(images: Sequence[np.ndarray], background: np.ndarray, sensor: SensorModel) -> list[np.ndarray]:
    """Return the penetration maps (H, W) m that the network measures in presses (320, 240, 3) uint8 RGB, without a
    calibration of the sensor's own. sensor: full size."""
    tdn = load_tdn("fast", sensor)
    return [tdn.predict(image, background) for image in images]


def measured_radius(maps: Sequence[np.ndarray], pixel: float) -> float | None:
    """Return the median radius [m] of the ball in `measured_maps` of `pixel` [m]; None if they show none."""
    bulging = [each for each in (curvature(one, pixel) for one in maps) if each is not None and each > 0]
    return 1 / float(np.median(bulging)) if bulging else None


def stretch_doubt(maps: Sequence[np.ndarray]) -> str:
    """Return a message if the contacts of a ball in `measured_maps`, as far as they are whole in view, are not round;
    otherwise empty."""
    ratios = []
    for one in maps:
        touched = np.argwhere(_deepest(one > 0, one))
        if len(touched) and (touched.min(axis=0) > 0).all() and (touched.max(axis=0) < np.array(one.shape) - 1).all():
            high, wide = touched.std(axis=0)
            ratios.append(np.log(wide / high) - _ROUND)
    if len(ratios) < 2:
        return ""
    ratio, uncertainty = float(np.median(ratios)), _OF_MEDIAN * float(np.std(ratios, ddof=1)) / np.sqrt(len(ratios))
    if abs(ratio) < max(_MOST_STRETCH, 2 * uncertainty):
        return ""
    shape = "wider than high" if ratio > 0 else "higher than wide"
    return (
        f"contacts of the ball are {np.expm1(abs(ratio)):.0%} {shape}; give images whose pixels are as wide as high (a "
        "mode or a crop of the camera's own shape), or press a ball"
    )


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


def curvature(penetration: np.ndarray, pixel: float, core_depth: float = _WIDE_CORE) -> float | None:
    """Return the mean curvature [1/m] of the core of a contact (H, W) m: the change of its slopes with the position.

    The core is what is deeper than a fraction `core_depth` of the deepest point; None if it is too small.
    """
    deepest = penetration.max()
    region = _deepest(penetration > core_depth * deepest, penetration)
    core = cv2.erode(region.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    if deepest <= 0 or core.sum() < _FEWEST_CORE_PIXELS:
        return None
    positions = np.argwhere(core)[:, ::-1] * pixel
    positions = positions - positions.mean(axis=0)
    slopes = height_slopes(penetration, pixel)[core]
    return -float((slopes * positions).sum() / (positions**2).sum())


def _deepest(inside: np.ndarray, penetration: np.ndarray) -> np.ndarray:
    """Return the connected part of a region (H, W) that holds the deepest point of a map (H, W)."""
    _, regions = cv2.connectedComponents(inside.astype(np.uint8))
    return inside & (regions == regions.flat[penetration.argmax()])


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
        true, curved = curvature(np.maximum(penetration, 0), tdn.sensor.pixel_size, CORE), []
        for tdn.calibration in (None, calibration):
            measured = tdn.predict(image, background)
            row.append(float(np.sqrt(((measured - penetration)[inside] ** 2).mean())))
            core = curvature(measured, tdn.sensor.pixel_size, CORE)
            curved.append(np.nan if core is None or true is None else core / true)
        rows.append(row)
        curvatures.append(curved)
    known = [row for row in curvatures if np.isfinite(row).all()] or [[np.nan, np.nan]]
    values = *np.median(rows, axis=0).tolist(), *np.median(known, axis=0).tolist()
    names = "felt_error_before", "felt_error_after", "curvature_before", "curvature_after"
    return dict(zip(names, values, strict=True))


def radius_doubt(figures: dict[str, float], ball_diameter: float) -> str:
    """Return a message if touches that a calibration was not fitted to do not have the radius of a ball of this
    diameter [m] (`depth_errors`); otherwise empty."""
    ratio = figures["curvature_after"]
    if np.isnan(ratio) or 1 / (1 + _MOST_RADIUS_OFF) <= ratio <= 1 + _MOST_RADIUS_OFF:
        return ""
    return (
        f"the ball of {1e3 * ball_diameter:g} mm is measured as one of {1e3 * ball_diameter / ratio:.1f} mm in touches "
        "that the calibration has not seen; check the diameter and the scale (px per mm), press straight and without "
        "sliding, not deeper than half the ball, and all over the gel"
    )


def gain_doubt(figures: dict[str, float]) -> str:
    """Return a message if a calibration does not improve the depth in touches that it was not fitted to
    (`depth_errors`); otherwise empty."""
    before, after = (1e3 * figures[f"felt_error_{when}"] for when in ("before", "after"))
    if after < before:
        return ""
    return (
        f"depth in touches that it has not seen is measured no better with it, off by {after:.3f} mm, and without by "
        f"{before:.3f} mm; press more often and all over the gel, straight and without sliding, or continue without it"
    )
