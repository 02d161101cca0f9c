"""Appearance of the filter's numbers: colours of weights, ellipsoids of covariances, lines of past poses, a scale."""

from __future__ import annotations

import numpy as np

from midastouch_common import se3

from ..drawing.scale import round_length

# Dark blue over red to yellow: brighter is heavier, also in grey.
_STOPS = np.array([[25, 10, 95], [150, 25, 125], [240, 90, 60], [255, 235, 90]], float)
# Two standard deviations, as the ellipsoids in RViz; nothing is thinner than a pixel of the sensor.
_SIGMAS, _THINNEST = 2.0, 1e-4


def weight_colours(weights: np.ndarray) -> np.ndarray:
    """Return RGB (N, 3) uint8 of weights (N,): dark for zero, bright for the heaviest.

    The square root keeps light particles distinct next to a much heavier one.
    """
    heaviest = weights.max(initial=0.0)
    fraction = np.sqrt(np.clip(weights / heaviest, 0.0, 1.0)) if heaviest > 0 else np.zeros(len(weights))
    at = np.linspace(0, 1, len(_STOPS))
    return np.stack([np.interp(fraction, at, channel) for channel in _STOPS.T], axis=1).astype(np.uint8)


def ellipsoids(covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return half axes (M, 3) m and quaternions xyzw (M, 4) of two-sigma ellipsoids of covariances (M, 3, 3) m^2."""
    variances, directions = np.linalg.eigh(covariances)
    directions[:, :, 0] *= np.sign(np.linalg.det(directions))[:, None]
    poses = np.tile(np.eye(4), (len(directions), 1, 1))
    poses[:, :3, :3] = directions
    half = _SIGMAS * np.sqrt(np.maximum(variances, _THINNEST**2))
    return half, se3.to_xyzquat(poses)[:, 3:]


def scale_bar(vertices: np.ndarray) -> tuple[np.ndarray, str]:
    """Return ends (2, 3) m of a line below the vertices (V, 3) m, along their longest side, and its length in words."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    axis = int(np.argmax(high - low))
    length, words = round_length(float(high[axis] - low[axis]))
    start = low - 0.05 * (high - low).max()
    return np.stack([start, start + length * np.eye(3)[axis]]), words


class Trail:
    """Trail of past positions: at most `length` of them, broken at jumps of more than `gap` [m]."""

    def __init__(self, length: int = 3000, gap: float = 0.01):
        self._length, self._gap = length, gap
        self._strips: list[list[np.ndarray]] = []

    def add(self, position: np.ndarray) -> None:
        """Add a position (3,) m."""
        if not self._strips or np.linalg.norm(position - self._strips[-1][-1]) > self._gap:
            self._strips.append([])
        self._strips[-1].append(position)
        if sum(map(len, self._strips)) > self._length:
            del self._strips[0][0]
            self._strips = [strip for strip in self._strips if strip]

    def clear(self) -> None:
        """Forget all positions."""
        self._strips.clear()

    @property
    def strips(self) -> list[np.ndarray]:
        """The positions as lines (K, 3) of two points and more."""
        return [np.array(strip) for strip in self._strips if len(strip) > 1]
