"""Fit of `MeasuredOptics` to the presses of a ball on a real sensor that `midastouch calibrate` has found."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from midastouch_perception.rendering.renderer import GelShape
from midastouch_perception.sensor_calibration.calibration import background_colours
from midastouch_perception.sensor_calibration.fit import Result
from midastouch_perception.sensor_calibration.response import position_terms
from midastouch_perception.tdn.inputs import RELATIVE_LEVEL, ContactLight, reduce_image

from .measured_optics import SIDE_TERMS, MeasuredOptics, normal_terms, positions_within, side_terms

_SHAPES = [GelShape(reach, fraction, 1.5e-4) for reach in (0.2e-3, 0.35e-3, 0.5e-3, 0.8e-3) for fraction in (0.6, 1.0)]
_EVERY = 2  # px; neighbours have nearly the same values
_FOLDS = 5
_RIDGES = (1e-3, 1e-2, 0.1)  # of a term's own weight; they keep terms small that presses do not determine
_POSITION_RIDGE = np.array([0.1, 1, 1, 2, 2, 2])  # light varies slowly with the position
_POSITION_TERMS = len(_POSITION_RIDGE)
_ALL_SLOPES = 1 - 1e-6  # sine: no limit


def fit_optics(name: str, source: str, images: dict[str, np.ndarray], result: Result) -> MeasuredOptics:
    """Fit the optics to images (320, 240, 3) uint8 RGB by name, of which `calibrate` made `result`.

    The gel's shape is the one, out of a few, with which the light best predicts presses left out of its fit.
    """
    used = [(p, np.maximum(m, 0)) for p, m in zip(result.presses, result.penetrations, strict=True) if m is not None]
    seen = [press.change / np.float32(RELATIVE_LEVEL) for press, _ in used]
    maps = [penetration for _, penetration in used]
    centres = np.array([np.argwhere(each > 0).mean(axis=0)[::-1] / each.shape[::-1] for each in maps])
    region = np.round(np.stack([centres.min(axis=0), centres.max(axis=0)], axis=1).ravel().clip(0, 1), 3)
    fits = [_LightFit(shape, maps, seen, region, result.sensor.pixel_size) for shape in _SHAPES]
    explained, ridge, best = max(
        ((fit.explained(ridge), ridge, fit) for fit in fits for ridge in _RIDGES), key=lambda each: each[0]
    )
    normal, sides = best.solve(range(len(used)), ridge)
    return MeasuredOptics(
        name=name,
        source=source,
        shape=best.shape,
        steepest=best.steepest,
        region=region,
        normal=normal,
        sides=sides,
        background=background_colours(result.background),
        explained=round(explained, 3),
        **_light_of_frames(images, result),
    )


class _LightFit:
    """Least squares for the light, for one shape of the gel. Attributes: shape; steepest, sine of the slope below which
    99 % of the touched pixels are."""

    def __init__(
        self, shape: GelShape, maps: list[np.ndarray], seen: list[np.ndarray], region: np.ndarray, pixel: float
    ):
        self.shape = shape
        heights = [shape.height(penetration, pixel) for penetration in maps]
        normals = [normal_terms(height, pixel, _ALL_SLOPES) for height in heights]
        sines = np.concatenate([np.sqrt(normal[touched > 0, 4]) for normal, touched in zip(normals, maps, strict=True)])
        self.steepest = round(float(np.quantile(sines, 0.99)), 3)
        positions = positions_within(region, *maps[0].shape)
        self._squares, self._products, self._energies = [], [], []
        for height, normal, change in zip(heights, normals, seen, strict=True):
            local = (normal[..., None] * positions[..., None, :]).reshape(*height.shape, -1)
            design = np.concatenate([local, side_terms(height, pixel, _ALL_SLOPES)], axis=-1)[::_EVERY, ::_EVERY]
            design = design.reshape(-1, design.shape[-1]).astype(float)
            target = change[::_EVERY, ::_EVERY].reshape(-1, 3).astype(float)
            self._squares.append(design.T @ design)
            self._products.append(design.T @ target)
            self._energies.append(float((target**2).sum()))

    def solve(self, presses: Iterable[int], ridge: float) -> tuple[np.ndarray, np.ndarray]:
        """Return factors (7, 6, 3) of the normal's terms and (18, 3) of the sides', from these presses."""
        found = self._solve(list(presses), ridge)
        return found[:-SIDE_TERMS].reshape(-1, 6, 3), found[-SIDE_TERMS:]

    def explained(self, ridge: float) -> float:
        """Return the fraction of a press's change that a fit to others explains, median over the presses."""
        fractions, count = {}, len(self._squares)
        for fold in range(_FOLDS):
            found = self._solve([i for i in range(count) if i % _FOLDS != fold], ridge)
            for i in range(fold, count, _FOLDS):
                gain = 2 * (found * self._products[i]).sum() - (found * (self._squares[i] @ found)).sum()
                fractions[i] = float(gain) / self._energies[i]
        return float(np.median(list(fractions.values())))

    def _solve(self, presses: list[int], ridge: float) -> np.ndarray:
        square, product = (sum(parts[i] for i in presses) for parts in (self._squares, self._products))
        own = np.diag(square)
        everywhere = own[:-SIDE_TERMS:_POSITION_TERMS]  # of the normal's terms alone
        penalty = np.concatenate([np.outer(everywhere, _POSITION_RIDGE).ravel(), own[-SIDE_TERMS:]])
        return np.linalg.solve(square + np.diag(ridge * penalty + 1e-12), product)


def _light_of_frames(images: dict[str, np.ndarray], result: Result) -> dict:
    """Return the variation from frame to frame: `exposure`, `drift` and `noise` of `MeasuredOptics`."""
    rest = reduce_image(result.background)
    light, positions = ContactLight(rest, "relative"), position_terms(*rest.shape[:2])
    flat = positions[::_EVERY, ::_EVERY].reshape(-1, positions.shape[-1])
    exposure, drift, noise = [], [], []
    for press in result.presses:
        if press.problem:
            continue
        image = reduce_image(images[press.name])
        exposure.append(np.log(np.median(image / np.maximum(rest, 1), axis=(0, 1))))
        slow = (light.difference(image) - press.change)[::_EVERY, ::_EVERY].reshape(-1, 3) / RELATIVE_LEVEL
        drift.append(np.linalg.lstsq(flat, slow, rcond=None)[0])
        # light changes slowly, so neighbours differ by noise; 1.48 times the median of |N(0, 1)| is 1
        step = np.diff(press.change * rest / RELATIVE_LEVEL, axis=1)
        noise.append(1.4826 * np.median(np.abs(step)) / np.sqrt(2))
    return {
        "exposure": np.sqrt(np.mean(np.square(exposure), axis=0)),
        "drift": np.sqrt(np.mean(np.square(drift), axis=(0, 2))),
        "noise": round(float(np.median(noise)), 2),
    }
