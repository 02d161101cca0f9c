"""Polynomial from colour to slope, one per sensor, fitted by least squares.

The classic look-up table of photometric stereo (Yuan, Dong and Adelson, Sensors 2017) as a regression: the slopes are
quadratic in the change of the three colours, with factors quadratic in the position.
"""

from __future__ import annotations

import cv2
import numpy as np

_TYPICAL_CHANGE = 50.0  # grey levels of a typical contact
TERMS = 12  # of the colours
_POSITION_TERMS = 6  # of the position
_INNER_RADIUS = 0.85  # radii: at the rim the gel leaves the ball
_OUTER_MARGIN = 0.25  # radii of the contact within which gel outside of it has unknown slopes
_EVERY = 2  # px; neighbours have nearly the same values
_LEAST_EXPLAINED = 0.5
_POSITION_RIDGE = np.array([0.1, 1, 1, 2, 2, 2])  # of the terms of the position: the constant is the freest
_RIDGE = 3e-3  # fraction of the equations' mean weight; it keeps terms small that presses do not determine
# fraction of the explained energy; positions with little evidence get the same steepness as the others
_STEEPNESS_RIDGE = 1e-3
STEEPEST = 2.0
"""Steepest slope that a colour may give. None within contacts of measured sensors is steeper than 1.6; for colours
outside the range of the presses, such as a glint's, the polynomial's value is no slope."""


def colour_terms(change: np.ndarray) -> np.ndarray:
    """Return terms (..., 12) float32 of changes of colour (..., 3) grey levels.

    They are linear, quadratic, and linear times the size of the change, because brightness levels off with slope.
    """
    r, g, b = np.moveaxis(np.asarray(change, np.float32) / np.float32(_TYPICAL_CHANGE), -1, 0)
    size = np.sqrt(r * r + g * g + b * b)
    return np.stack([r, g, b, r * r, g * g, b * b, r * g, g * b, r * b, r * size, g * size, b * size], axis=-1)


def position_terms(height: int, width: int) -> np.ndarray:
    """Return terms (H, W, 6) float32 of the pixels' positions."""
    v, u = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j].astype(np.float32)
    return np.stack([np.ones_like(u), u, v, u * u - 1 / 3, u * v, v * v - 1 / 3], axis=-1)


class NormalEquations:
    """Sums over presses for a least-squares fit of the polynomial; sums of several presses can be added."""

    def __init__(self) -> None:
        size = TERMS * _POSITION_TERMS
        self.square = np.zeros((size, size))
        self.targets = np.zeros((_POSITION_TERMS, size, 2))  # with the slopes times each term of the position
        self.energies = np.zeros(_POSITION_TERMS)  # of the slopes, times each term of the position
        self.weight = 0.0  # of the pixels

    @classmethod
    def of(cls, change: np.ndarray, slopes: np.ndarray, weight: np.ndarray) -> NormalEquations:
        """Make the sums of one press: change (H, W, 3) grey levels, slopes (H, W, 2) right and down, weight (H, W), 0
        if the slope is unknown."""
        out = cls()
        positions = position_terms(*weight.shape)
        change, slopes, weight, positions = (a[::_EVERY, ::_EVERY] for a in (change, slopes, weight, positions))
        known = weight > 0
        slopes, weight, positions = slopes[known].astype(np.float32), weight[known][:, None], positions[known]
        design = (colour_terms(change[known])[:, :, None] * positions[:, None, :]).reshape(len(positions), -1)
        weighted = design * weight
        out.square = weighted.T @ design
        out.targets = np.stack([weighted.T @ (slopes * term[:, None]) for term in positions.T])
        out.energies = positions.T @ (weight * slopes**2).sum(axis=1)
        out.weight = float(weight.sum())
        return out

    def __add__(self, other: NormalEquations) -> NormalEquations:
        out = NormalEquations()
        for name, value in vars(self).items():
            setattr(out, name, value + getattr(other, name))
        return out

    def solve(self) -> np.ndarray:
        """Return the coefficients (12, 6, 2) of the slopes. With few presses the position's terms stay small.

        Least squares predict slopes that are too flat, by the fraction that the colours do not explain: noise, shadows,
        and misplaced circles. Shapes must not become flatter by that, nor flatter near a lamp that outshines others. So
        we fit the slopes times a quadratic in the position, and solve for that quadratic such that the slopes are as
        steep as the balls' on average, and on the average weighted by each term of the position.
        """
        ridge = np.diag(_RIDGE * self.weight * np.tile(_POSITION_RIDGE, TERMS) + 1e-12)
        found = np.stack([np.linalg.solve(self.square + ridge, target) for target in self.targets])
        steep = np.einsum("kpd,lpd->lk", found, self.targets)  # projection on the balls' slopes, weighted by each term
        explained = max(steep[0, 0], _LEAST_EXPLAINED * self.energies[0], 1e-12)
        steep += explained * np.diag([0, *(_STEEPNESS_RIDGE * _POSITION_RIDGE[1:])])
        steep[0, 0] = explained
        factors = np.linalg.solve(steep, self.energies)
        return np.tensordot(factors, found, 1).reshape(TERMS, _POSITION_TERMS, 2)


def press_equations(change: np.ndarray, penetration: np.ndarray, pixel: float) -> NormalEquations:
    """Return the equations of one press of a ball: gel well inside the contact is as steep as the ball, gel away from
    it is flat, in spite of shadows.

    Both parts have the same weight. Weighted by pixels, the flat gel would outweigh the contact ten times: colours that
    also occur in shadows would give too little slope, and a press would be too flat by the fraction of such colours in
    it.

    change (H, W, 3) grey levels; penetration (H, W) m, negative outside the contact (`ball_penetration`); pixel, m per
    pixel.
    """
    touched = (penetration > 0).astype(np.uint8)
    radius = np.sqrt(touched.sum() / np.pi)
    beyond = cv2.distanceTransform(1 - touched, cv2.DIST_L2, 5) > _OUTER_MARGIN * radius
    inside = well_inside(penetration)
    evenly = min(1.0, inside.sum() / max(beyond.sum(), 1))
    weight = np.where(inside, np.float32(1), np.float32(evenly) * beyond)
    return NormalEquations.of(change, height_slopes(np.maximum(penetration, 0), pixel), weight)


def well_inside(penetration: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool where gel has the slopes of an object with a penetration (H, W) m, negative outside
    the contact."""
    touched = (penetration > 0).astype(np.uint8)
    return cv2.distanceTransform(touched, cv2.DIST_L2, 5) > (1 - _INNER_RADIUS) * np.sqrt(touched.sum() / np.pi)


def height_slopes(height: np.ndarray, pixel: float) -> np.ndarray:
    """Return the slopes (H, W, 2) float32, to the right and down, of a height (H, W) float32 m."""
    slopes = [cv2.Sobel(height, cv2.CV_32F, *axis) / np.float32(8 * pixel) for axis in ((1, 0), (0, 1))]
    return np.stack(slopes, axis=-1)


class ColourResponse:
    """Fitted polynomial from colours to slopes; coefficients (12, 6, 2)."""

    def __init__(self, coefficients: np.ndarray):
        self._coefficients = coefficients
        self._factors: np.ndarray | None = None

    def slopes(self, change: np.ndarray) -> np.ndarray:
        """Return the gel's slopes (H, W, 2) float32, to the right and down, for changes (H, W, 3) grey levels; at most
        `STEEPEST`."""
        if self._factors is None or self._factors.shape[:2] != change.shape[:2]:
            positions = position_terms(*change.shape[:2])
            self._factors = np.einsum("tps,hwp->hwts", self._coefficients, positions).astype(np.float32)
        slopes = (colour_terms(change)[..., None, :] @ self._factors)[..., 0, :]
        steepness = np.sqrt(np.square(slopes).sum(axis=-1, keepdims=True))
        return slopes * (np.float32(STEEPEST) / np.maximum(steepness, np.float32(STEEPEST)))
