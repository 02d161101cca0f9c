"""Refinement of contacts: in turn, the light is fitted to all presses, and each contact moves to where it fits best."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
from scipy.optimize import least_squares

from ..rendering.renderer import sunk_in
from ..sensor_model import SensorModel
from .ball import BallContact, ball_centre, ball_penetration
from .response import height_slopes, position_terms

_ROUNDS = 2
_EVERY = 2  # px
_REACH, _LENS = 0.3e-3, 0.1e-3  # m, as in `ball.py`
_RIDGE = 1e-3
LEVELS = 15.0  # grey levels; a larger residual counts less, because shadows are not modelled
_RADII = 0.1, 0.97  # of the ball's


def refine_contacts(
    changes: list[np.ndarray], contacts: list[BallContact], ball_radius: float, sensor: SensorModel
) -> list[BallContact]:
    """Return the contacts moved, each with the fraction of its press that the joint light explains.

    changes: (H, W, 3) grey levels each. The light is the same for all presses: every colour is quadratic in the slopes,
    with factors quadratic in the position.
    """
    for _ in range(_ROUNDS):
        factors = fit_light(changes, [_shape(c, ball_radius, sensor) for c in contacts])
        contacts = [_moved(x, c, factors, ball_radius, sensor) for x, c in zip(changes, contacts, strict=True)]
    return contacts


def _shape(contact: BallContact, ball_radius: float, sensor: SensorModel) -> np.ndarray:
    centre = ball_centre(contact.u, contact.v, contact.radius, ball_radius, sensor)
    return slope_terms(np.maximum(ball_penetration(centre, ball_radius, sensor), 0), sensor)


def slope_terms(touched: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Return terms (h, w, 5) of the gel's slopes, linear and quadratic, for a penetration (H, W) m, at the pixels of
    `looked_at`."""
    height = sunk_in(touched, sensor.pixel_size, _REACH, 1.0)
    slopes = height_slopes(cv2.GaussianBlur(height, (0, 0), _LENS / sensor.pixel_size), sensor.pixel_size)
    x, y = slopes[..., 0], slopes[..., 1]
    return np.stack([x, y, x * x - y * y, 2 * x * y, x * x + y * y], axis=-1)[::_EVERY, ::_EVERY]


def looked_at(change: np.ndarray) -> np.ndarray:
    """Return the pixels (h, w, 3) of a change (H, W, 3) to look at; neighbours have nearly the same values."""
    return change[::_EVERY, ::_EVERY]


def lit(shape: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return the change (h, w, 3) of the colours by terms (h, w, 5) under a light (h, w, 5, 3)."""
    return (shape[..., None, :] @ factors)[..., 0, :]


def fit_light(changes: list[np.ndarray], shapes: list[np.ndarray]) -> np.ndarray:
    """Fit the factors (h, w, 5, 3) of the terms (h, w, 5) in each colour to changes (H, W, 3) grey levels."""
    positions = position_terms(*changes[0].shape[:2])[::_EVERY, ::_EVERY]
    size = shapes[0].shape[-1] * positions.shape[-1]
    square, target = np.zeros((size, size)), np.zeros((size, 3))
    for change, shape in zip(changes, shapes, strict=True):
        design = (shape[..., None] * positions[..., None, :]).reshape(-1, size).astype(float)
        square += design.T @ design
        target += design.T @ looked_at(change).reshape(-1, 3)
    ridge = _RIDGE * np.trace(square) / size * np.tile([0.1, 1, 1, 3, 3, 3], shapes[0].shape[-1])
    weights = np.linalg.solve(square + np.diag(ridge + 1e-9), target)
    return np.einsum("kpc,hwp->hwkc", weights.reshape(-1, positions.shape[-1], 3), positions).astype(np.float32)


def _moved(
    change: np.ndarray, contact: BallContact, factors: np.ndarray, ball_radius: float, sensor: SensorModel
) -> BallContact:
    seen = looked_at(change)

    def at(values: np.ndarray) -> BallContact:
        u, v, ratio = values
        return dataclasses.replace(contact, u=u, v=v, radius=float(np.clip(ratio, *_RADII)) * ball_radius)

    def residual(values: np.ndarray) -> np.ndarray:
        shape = _shape(at(values), ball_radius, sensor)
        return (seen - lit(shape, factors)).ravel()

    start = [contact.u, contact.v, contact.radius / ball_radius]
    found = least_squares(
        residual, start, loss="soft_l1", f_scale=LEVELS, diff_step=[3e-3, 3e-3, 1e-2], x_scale=[2, 2, 0.05], max_nfev=8
    )
    explained = 1 - float((residual(found.x) ** 2).sum()) / max(float((seen**2).sum()), 1e-9)
    return dataclasses.replace(at(found.x), explained=explained)
