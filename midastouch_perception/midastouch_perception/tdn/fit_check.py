"""Fit check: do this sensor's images look like those that the depth network was trained for?

It computes three cheap figures of each image:

- *quietest tenth*: at any pressure, a tenth of the image stays as without contact, except for the frame's brightness,
  which the difference does not contain. If it does not, the background is of another sensor or turned.
- *far change*: a difference from the no-contact image far from every contact is not caused by contact. If it is larger
  than a drift of the light, which is learned and removed (`LightDrift`), the no-contact image no longer fits.
- *explained fraction*: the light on a bump depends on the bump's slopes. If the slopes of the measured penetration map
  do not explain the image by some linear optics, the network has measured a shape that is not there. Changes of lamps
  and exposure between frames vary slowly over the image and need no explanation.

Simulated sensors like those of the training seldom exceed the limits: the report `checks` measures how seldom, and how
reliably sensors that do not fit exceed them.
"""

from __future__ import annotations

import collections
import functools

import cv2
import numpy as np

from ..rendering.renderer import GelShape
from ..sensor_calibration.response import height_slopes, position_terms
from ..sensor_model import SensorModel
from .inputs import BLOCKS, DRIFT_GRID, LARGEST_DRIFT, block_means

_FAR = 1.6e-3  # m from a contact, beyond which gel looks untouched
_LEAST_FAR = 0.8  # of a region
_LEAST_CHANGE = 1.5  # grey levels, root mean square over blocks: below it there is nothing to explain
QUIET_LIMIT = 5.0  # grey levels
EXPLAINED_LIMIT = {"additive": 0.5, "relative": 0.75}
"""Smallest explained fraction by `SensorModel.light`; it is higher on real gel, whose light is known better."""
_GELS = GelShape(0.3e-3, 0.0, 0.1e-3), GelShape(0.5e-3, 1.0, 0.25e-3), GelShape(0.7e-3, 1.0, 0.5e-3)
"""Gels from one that follows every edge to one that sinks in far around it."""


def explained_fraction(
    difference: np.ndarray, penetration: np.ndarray, pixel: float, least_change: float = _LEAST_CHANGE
) -> float | None:
    """Return the fraction (0 ... 1) of a difference image's energy that its penetration map explains; None without a
    visible change.

    difference (H, W, 3) grey levels; penetration (H, W) m; pixel, m per pixel; least_change, smallest visible change in
    grey levels, root mean square over blocks. Optics are fitted to each image: every channel is linear in the slopes of
    the gel around the contact, with factors linear in the position, plus a quadratic in the slopes. The gel that
    explains most is taken out of a few. Any change that is quadratic in the position does not count.
    """
    slow = _slow_terms()
    seen = _without(slow, block_means(difference).reshape(-1, 3))
    energy = float((seen**2).sum())
    if energy <= least_change**2 * seen.size:
        return None
    left = []
    for gel in _GELS:
        design = _without(slow, _light_terms(gel.height(penetration, pixel), pixel).astype(float))
        design /= np.linalg.norm(design, axis=0) + 1e-9
        # without the ridge the system is singular for a straight edge, which makes terms equal
        weights = np.linalg.solve(design.T @ design + 1e-3 * np.eye(design.shape[1]), design.T @ seen)
        left.append(float(((seen - design @ weights) ** 2).sum()))
    return 1 - min(left) / energy


@functools.cache
def _slow_terms() -> np.ndarray:
    """Return an orthonormal base (B, 6) of the changes over the blocks that are quadratic in the position."""
    return np.linalg.qr(position_terms(*BLOCKS).reshape(-1, 6))[0]


def _light_terms(height: np.ndarray, pixel: float) -> np.ndarray:
    """Return terms (N, 9) of the light at each of N blocks on gel of a height (H, W) m, from its normals."""
    slopes = height_slopes(height, pixel)
    sines = slopes / np.sqrt(1 + (slopes**2).sum(axis=2, keepdims=True))
    x, y = sines[..., 0], sines[..., 1]
    positions = position_terms(*BLOCKS)[..., :3]
    linear = [block_means(along)[..., None] * positions for along in (x, y)]
    squares = block_means(np.stack([x * x, y * y, x * y], axis=2))
    return np.concatenate([*linear, squares], axis=2).reshape(-1, 9)


def _without(base: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return columns (N, K) minus their projection on an orthonormal base (N, B)."""
    return columns - base @ (base.T @ columns)


def quietest_tenth(difference: np.ndarray) -> float:
    """Return the limit [grey levels] within which the quietest tenth of a difference image (H, W, 3) stays."""
    change = np.abs(block_means(difference)).max(axis=2).ravel()
    return float(np.partition(change, len(change) // 10)[len(change) // 10])


def far_change(change: np.ndarray, penetration: np.ndarray, pixel: float) -> float:
    """Return the largest mean change [grey levels] of any twentieth of the image that lies far from every contact; 0 if
    none does.

    change (H, W, 3) grey levels from the no-contact image, before the drift of the light is removed; penetration
    (H, W) m; pixel, m per pixel.
    """
    reach = 2 * round(_FAR / pixel) + 1
    far = 1.0 - cv2.dilate((penetration > 0).astype(np.float32), np.ones((reach, reach), np.uint8))
    free, seen = (
        cv2.resize(each, DRIFT_GRID[::-1], interpolation=cv2.INTER_AREA) for each in (far, change * far[..., None])
    )
    free = free.reshape(-1)
    mean = np.abs(seen.reshape(-1, 3)[free > _LEAST_FAR] / free[free > _LEAST_FAR, None])
    return float(mean.max(initial=0.0))


class FitCheck:
    """Check of one sensor's frames, by the median of each figure over the last frames looked at.

    Parameters
    ----------
    sensor
        At the map's resolution.
    every
        Number of frames through the network out of which one is looked at.
    window
        Number of frames looked at that count. There is no verdict before a third of the window.
    """

    def __init__(self, sensor: SensorModel, every: int = 5, window: int = 15):
        self._pixel, self._limit = sensor.pixel_size, EXPLAINED_LIMIT[sensor.light]
        self._every, self._enough = every, max(1, window // 3)
        self._frames = 0
        self._quiet: collections.deque[float] = collections.deque(maxlen=window)
        self._explained: collections.deque[float] = collections.deque(maxlen=window)
        self._far: collections.deque[float] = collections.deque(maxlen=window)

    def observe(self, change: np.ndarray, difference: np.ndarray, penetration: np.ndarray) -> None:
        """Take one frame.

        Parameters
        ----------
        change, difference : (H, W, 3) [grey levels]
            The frame's change, and the network's input.
        penetration : (H, W) of the network [m]
        """
        self._frames += 1
        if (self._frames - 1) % self._every:
            return
        self._quiet.append(quietest_tenth(difference))
        self._far.append(far_change(change, penetration, self._pixel))
        explained = explained_fraction(difference, penetration, self._pixel)
        if explained is not None:
            self._explained.append(explained)

    def reset(self) -> None:
        """Forget all frames, because the background has changed."""
        for figures in (self._quiet, self._explained, self._far):
            figures.clear()

    @property
    def quiet(self) -> float | None:
        """Median quietest tenth [grey levels]; None before enough frames."""
        return self._median(self._quiet)

    @property
    def far(self) -> float | None:
        """Median far change [grey levels]; None before enough frames."""
        return self._median(self._far)

    @property
    def explained(self) -> float | None:
        """Median explained fraction; None before enough frames with a visible change."""
        return self._median(self._explained)

    @property
    def values(self) -> dict[str, str]:
        """Figures for the diagnostics."""
        figures = {"quietest_tenth": self.quiet, "far_change": self.far, "explained_share": self.explained}
        return {name: "" if value is None else f"{value:.2f}" for name, value in figures.items()}

    def _median(self, values: collections.deque) -> float | None:
        return float(np.median(values)) if len(values) >= self._enough else None

    @property
    def problem(self) -> str:
        """Problem of the images and its fix, as text; empty if they fit."""
        if self.quiet is not None and self.quiet > QUIET_LIMIT:
            return (
                f"no part of the image is as in the no-contact image (off by {self.quiet:.0f} grey levels): it is "
                "another sensor's or another gel's, or light falls in from outside; lift the finger and call "
                "capture_background"
            )
        if self.far is not None and self.far > LARGEST_DRIFT:
            return (
                f"the image is off by {self.far:.0f} grey levels far from all that touches: the light has changed "
                "since the no-contact image, or falls in from outside; shield the sensor, lift the finger and call "
                "capture_background"
            )
        if self.explained is not None and self.explained < self._limit:
            return (
                f"the penetration map explains {100 * self.explained:.0f} % of what the images show: the no-contact "
                "image shows a contact (lift the finger and call capture_background), or this sensor is lit unlike "
                "those the network was trained for (press a ball and run midastouch calibrate)"
            )
        return ""
