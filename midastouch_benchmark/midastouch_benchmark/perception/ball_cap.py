"""The ball nearest to surface points, and the cap that a ball of known radius presses into a domed gel."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
from scipy.optimize import least_squares, minimize

from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_calibration.ball import ball_penetration
from midastouch_perception.sensor_model import SensorModel


@dataclasses.dataclass(frozen=True)
class Sphere:
    """Sphere fitted to points; centre: (3,) m; radius: m; residual: root mean square distance [m] of the points."""

    centre: np.ndarray
    radius: float
    residual: float


def fit_sphere(points: np.ndarray, radius: float | None = None) -> Sphere:
    """Return the sphere nearest to points (N, 3) m, N >= 4, by orthogonal distance; with the given radius, if any.

    The points are the side of a ball that faces +z (the camera): its centre lies below them. If they are an outline on
    the undeformed gel, the sphere is the ball that meets the gel there; one wider than the ball leaves a residual.
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
    """Return both principal curvatures (2,) [1/m], ascending, of surface points (N, 3) m, N >= 6, near their middle.

    They are those of a fitted quadric z(x, y), positive if it bulges towards +z, as a ball pressed into the gel does.
    """
    x, y, z = (np.asarray(points, float) - np.mean(points, axis=0)).T
    terms = np.column_stack([np.ones_like(x), x, y, x**2 / 2, x * y, y**2 / 2])
    _, slope_x, slope_y, xx, xy, yy = np.linalg.lstsq(terms, z, rcond=None)[0]
    first = np.array([[1 + slope_x**2, slope_x * slope_y], [slope_x * slope_y, 1 + slope_y**2]])
    second = np.array([[xx, xy], [xy, yy]]) / np.sqrt(1 + slope_x**2 + slope_y**2)
    return np.sort(-np.linalg.eigvals(np.linalg.solve(first, second)).real)


_STEP = 3e-4  # m: first step of the search for the nearest cap


def cap_penetration(centre: np.ndarray, radius: float, sensor: SensorModel) -> np.ndarray:
    """Return the penetration (H, W) float32 m, at least 0, of a rigid ball with centre (3,) m in the gel frame."""
    return np.maximum(ball_penetration(centre, radius, sensor), 0)


def circle_outline(circle: tuple[float, float, float], scale: float, sensor: SensorModel) -> np.ndarray:
    """Return points (64, 3) m on the gel of a circle in an image: centre column, centre row, radius [px].

    scale: pixels of `sensor` per pixel of that image.
    """
    column, row, radius = circle
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    # a label names a pixel; its centre is half a pixel further
    pixels = np.column_stack([column + radius * np.cos(angle), row + radius * np.sin(angle)]) + 0.5
    return sensor.gel_points(scale * pixels)


def mask_outline(mask: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Return points (N, 3) m on the gel of the outline of a roundish mask (H, W) bool, except along the image edge."""
    contours = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    pixels = max(contours, key=len)[:, 0] if contours else np.zeros((0, 2), int)
    last = np.array(mask.shape[::-1]) - 1
    inner = ((pixels > 0) & (pixels < last)).all(axis=1)
    if not inner.any():
        return np.zeros((0, 3))
    outward = pixels - pixels.mean(axis=0)
    # the outline runs between the last pixel inside and the first outside
    outward *= 0.5 / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    return sensor.gel_points((pixels + outward)[inner] + 0.5)


def nearest_cap(penetration: np.ndarray, contact: np.ndarray, radius: float, sensor: SensorModel) -> np.ndarray:
    """Return the centre (3,) m of the ball whose penetration is nearest to a map (H, W) m, by squares over all pixels.

    contact: (H, W) bool, not empty; the search starts from it.
    """
    points = cloud_from_penetration(penetration, contact, sensor).astype(float)
    start = fit_sphere(points, radius).centre if len(points) > 3 else points.mean(axis=0) - [0, 0, radius]

    def distance(centre: np.ndarray) -> float:
        return float(((cap_penetration(centre, radius, sensor) - penetration) ** 2).sum()) * 1e6

    simplex = start + np.vstack([np.zeros(3), _STEP * np.eye(3)])
    # the squares are not smooth where pixels enter and leave the cap: no derivatives
    options = {"initial_simplex": simplex, "xatol": 1e-6, "fatol": 1e-4}
    return minimize(distance, start, method="Nelder-Mead", options=options).x
