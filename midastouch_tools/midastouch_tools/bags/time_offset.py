"""Offset between the stamps of images and those of the arm's transforms, estimated from a recorded slide.

While the sensor slides, its image changes: faster when the arm moves faster, and not at all while the arm rests. The
shift in time at which the two agree best is the offset (cross-correlation).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError

from .images import BagFrame

_BLOCKS = (12, 16)  # columns and rows: noise averages out within a block, motion does not
_LEVER = 0.01  # m; a rotation by an angle changes the image about as much as a shift by this times the angle
_STEP = 0.005  # s
_SHORTEST_SLIDE_S = 5.0
_LARGEST_OFFSET_S = 0.5  # either way
_CLEAR = 0.5  # least correlation of an estimate


class TimeOffset(NamedTuple):
    """Stamp of an image minus that of the transform of the same moment [s], and the correlation there, at most 1."""

    seconds: float
    correlation: float


def estimate_time_offset(frames: Iterable[BagFrame], source: str) -> TimeOffset:
    """Estimate the offset, at most half a second either way, from images and the poses at their stamps.

    Raises InputError, naming `source`, if the recording does not determine it: too short, an arm that never changes
    its speed, a sensor that slides over nothing.
    """
    times, changes, speeds = _activity(frames)
    if len(times) < 2 or times[-1] - times[0] < _SHORTEST_SLIDE_S + 2 * _LARGEST_OFFSET_S:
        needed = _SHORTEST_SLIDE_S + 2 * _LARGEST_OFFSET_S
        raise InputError(f"{source}: needs {needed:g} s of images with poses; record a longer slide")
    grid = np.arange(times[0], times[-1], _STEP)
    # square roots: at large values the two are no longer proportional
    change, speed = (np.sqrt(np.interp(grid, times, values)) for values in (changes, speeds))
    lags = np.arange(-round(_LARGEST_OFFSET_S / _STEP), round(_LARGEST_OFFSET_S / _STEP) + 1)
    agreement = np.array([_correlation(change, speed, lag) for lag in lags])
    best = int(agreement.argmax())
    if agreement[best] < _CLEAR or best in (0, len(lags) - 1):
        raise InputError(
            f"{source}: images and arm disagree (correlation {agreement[best]:.2f} within {_LARGEST_OFFSET_S:g} s): "
            "slide over edges of an object, and start and stop several times"
        )
    before, at, after = agreement[best - 1 : best + 2]
    vertex = 0.5 * (before - after) / (before - 2 * at + after)
    return TimeOffset(float((lags[best] + vertex) * _STEP), float(at))


def _activity(frames: Iterable[BagFrame]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return middle [s], image change [grey levels / s] and gel speed [m / s] between each frame and the next."""
    rows, last = [], None
    for frame in frames:
        small = cv2.resize(frame.image, _BLOCKS, interpolation=cv2.INTER_AREA).astype(np.float32)
        if last is not None and frame.stamp_ns > last[0]:
            seconds = 1e-9 * (frame.stamp_ns - last[0])
            moved = se3.log(se3.inverse(last[2]) @ frame.base_from_gel)
            way = np.linalg.norm(moved[:3]) + _LEVER * np.linalg.norm(moved[3:])
            middle = 1e-9 * last[0] + 0.5 * seconds
            rows.append((middle, float(np.abs(small - last[1]).mean()) / seconds, way / seconds))
        last = frame.stamp_ns, small, frame.base_from_gel
    times, changes, speeds = np.array(rows).reshape(-1, 3).T
    return times, changes, speeds


def _correlation(change: np.ndarray, speed: np.ndarray, lag: np.integer) -> float:
    """Pearson correlation of the speed with the change `lag` steps later; 0 if one of them is constant."""
    later = change[lag:] if lag >= 0 else change[:lag]
    earlier = speed[: len(speed) - lag] if lag >= 0 else speed[-lag:]
    later, earlier = later - later.mean(), earlier - earlier.mean()
    norm = np.linalg.norm(later) * np.linalg.norm(earlier)
    return float(later @ earlier / norm) if norm > 0 else 0.0
