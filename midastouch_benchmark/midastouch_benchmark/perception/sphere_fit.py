"""Is a felt relief that of a ball? Sphere and principal curvatures of surface points, by least squares."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.optimize import least_squares


@dataclasses.dataclass(frozen=True)
class Sphere:
    """centre (3,) m, radius m, residual: root mean square distance [m] of the points from the sphere."""

    centre: np.ndarray
    radius: float
    residual: float


def fit_sphere(points: np.ndarray, radius: float | None = None) -> Sphere:
    """The sphere nearest to points (N, 3) m, N >= 4, by orthogonal distance; of a given radius if one is given.

    The points are the side of a ball that faces +z (the camera): its centre lies below them.
    """
    points = np.asarray(points, float)
    middle = points.mean(axis=0)
    x = points - middle
    if radius is None:
        # |x|^2 = 2 x.c + (r^2 - |c|^2) is linear in the unknowns: the start for the orthogonal fit
        solution = np.linalg.lstsq(np.column_stack([2 * x, np.ones(len(x))]), (x**2).sum(axis=1), rcond=None)[0]
        start = np.append(solution[:3], np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 1e-12)))
        found = least_squares(lambda s: np.linalg.norm(x - s[:3], axis=1) - s[3], start, x_scale=1e-3).x
        centre, radius = found[:3], float(abs(found[3]))
    else:
        start = np.array([0, 0, x[:, 2].max() - radius])
        centre = least_squares(lambda c: np.linalg.norm(x - c, axis=1) - radius, start, x_scale=1e-3).x
    distance = np.linalg.norm(x - centre, axis=1) - radius
    return Sphere(centre + middle, float(radius), float(np.sqrt(np.mean(distance**2))))


def principal_curvatures(points: np.ndarray) -> np.ndarray:
    """Both principal curvatures (2,) [1/m], ascending, of surface points (N, 3) m, N >= 6, near their middle.

    From a fitted quadric z(x, y); positive where the surface bulges towards +z, as a ball pressed into the gel does.
    """
    x, y, z = (np.asarray(points, float) - np.mean(points, axis=0)).T
    terms = np.column_stack([np.ones_like(x), x, y, x**2 / 2, x * y, y**2 / 2])
    _, slope_x, slope_y, xx, xy, yy = np.linalg.lstsq(terms, z, rcond=None)[0]
    first = np.array([[1 + slope_x**2, slope_x * slope_y], [slope_x * slope_y, 1 + slope_y**2]])
    second = np.array([[xx, xy], [xy, yy]]) / np.sqrt(1 + slope_x**2 + slope_y**2)
    return np.sort(-np.linalg.eigvals(np.linalg.solve(first, second)).real)
