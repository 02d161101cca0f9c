"""Quality of the depth network on presses of a ball of known size on a real sensor: depth, roundness and place.

The network should measure the cap of that ball. The cap's outline on the gel gives its depth: the labelled outline or,
without labels, the one that the images show (`press_truth.py`). If neither is known, the measured outline stands in. It
does not depend on the measured depth, but it is the network's own, and so are its errors: depth is not judged by it.
(Gel sinks in around a ball: the true depth lies between one and two caps.)

Only the shape is judged by the best fit: `felt_radius_mm` of the free sphere, `iou` with the nearest cap of the true
radius. Labels are some tenths of a millimetre off, so `iou_ideal` with the cap under the outline cannot reach 1.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping

import cv2
import numpy as np
import pandas as pd
from scipy.optimize import least_squares, minimize

from midastouch_common.errors import InputError
from midastouch_perception.contact import TOUCHED, ContactDetector
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_calibration.ball import ball_penetration
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet
from midastouch_tools.datasets.ball_presses import LABELS, BallPresses, Circle
from midastouch_tools.progress import progress_bar


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


_VISIBLE = 15.0  # grey levels: a change the eye sees too
_HALO = 0.5e-3  # m around what is visible
_CORE = 0.5  # of the deepest penetration: the rim is smeared by the gel, which cannot follow it
_FEWEST = 40  # px a core needs for a fit, and an outline
_OUTLINE_RESIDUAL = 0.15e-3  # m by which a labelled circle may miss the ball
_LARGEST_BALL = 0.1  # m


@dataclasses.dataclass(frozen=True)
class MeasuredPress:
    """One press as measured. Attributes: name; image: (320, 240, 3) uint8; difference: (h, w, 3) grey levels; measured,
    ideal: maps (h, w) m; ideal is None if neither a circle nor an outline is known; found: the pipeline's contact
    decision; truth, nearest: centres (3,) m of the ideal ball and of the one nearest to the measured map, or None.
    """

    name: str
    image: np.ndarray
    difference: np.ndarray
    measured: np.ndarray
    found: bool
    ideal: np.ndarray | None
    truth: np.ndarray | None
    nearest: np.ndarray | None


def as_measured(
    tdn: DepthNet, presses: BallPresses, radius: float, calibrations: Mapping[str, SensorCalibration] | None
) -> Iterator[MeasuredPress]:
    """Yield every press as measured, and its ideal map for a ball of `radius` m; calibrations: of each press, if given.

    Raises InputError if the radius is not that of a ball, or too small for a labelled circle.
    """
    if not 0 < radius <= _LARGEST_BALL / 2:
        raise InputError(f"ball of {2 * radius:g} m diameter: give it in metres, 0.0088 for 8.8 mm")
    for name, image in presses.images.items():
        if calibrations is not None:
            tdn.calibration = calibrations[name]
        difference = tdn.difference(image, presses.background)
        measured = tdn.predict(image, presses.background, difference)
        region = _measured_contact(difference, measured, tdn.sensor)
        if presses.circles is None:
            outline = mask_outline(_measured_contact(difference, measured, tdn.sensor, 0.0), tdn.sensor)
            truth = fit_sphere(outline, radius).centre if len(outline) >= _FEWEST else None
        elif circle := presses.circles.get(name):
            truth = _under_circle(name, circle, measured.shape[1] / image.shape[1], radius, tdn.sensor)
        else:
            truth = None
        ideal = None if truth is None else cap_penetration(truth, radius, tdn.sensor)
        nearest = nearest_cap(measured, region, radius, tdn.sensor) if region.any() else None
        found = ContactDetector(tdn.sensor).update(measured).in_contact and bool(region.any())
        yield MeasuredPress(name, image, difference, measured, found, ideal, truth, nearest)


def measure_presses(
    tdn: DepthNet, presses: BallPresses, radius: float, calibrations: Mapping[str, SensorCalibration] | None = None
) -> tuple[list[dict], dict]:
    """Return the figures of every press and their summary: `presses` and `summary` of the JSON."""
    measured = as_measured(tdn, presses, radius, calibrations)
    shown = progress_bar(iterable=measured, total=len(presses.images), unit="press")
    rows = [{"image": press.name, **_describe(press, radius, tdn.sensor)} for press in shown]
    return rows, _summary(rows, presses.truth)


def visible_contact(difference: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Return the mask (H, W) bool of a contact and its shadow in a difference image (H, W, 3), grey levels.

    It is the largest connected region of visible change and its surroundings within half a millimetre.
    """
    change = np.abs(cv2.GaussianBlur(difference, (0, 0), 1.5)).max(axis=2) > _VISIBLE
    region = _largest_region(change)
    reach = round(_HALO * sensor.focal / sensor.gel_distance)
    return cv2.dilate(region.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=reach) > 0


def _measured_contact(
    difference: np.ndarray, measured: np.ndarray, sensor: SensorModel, above: float = TOUCHED
) -> np.ndarray:
    """Return the largest region (H, W) bool of visible contact whose penetration exceeds `above` [m]."""
    return _largest_region((measured > above) & visible_contact(difference, sensor))


def _under_circle(name: str, circle: Circle, scale: float, radius: float, sensor: SensorModel) -> np.ndarray:
    """Return the ball's centre (3,) m under a labelled circle; scale: pixels of the map per pixel of its image."""
    ball = fit_sphere(circle_outline(circle, scale, sensor), radius)
    if ball.residual > _OUTLINE_RESIDUAL:
        raise InputError(
            f"{name}: a ball of {2e3 * radius:g} mm diameter leaves no contact as wide as its circle, "
            f"{2e3 * circle[2] * scale * sensor.pixel_size:.1f} mm; check --ball-diameter, --px-per-mm and the label"
        )
    return ball.centre


def _describe(press: MeasuredPress, radius: float, sensor: SensorModel) -> dict:
    visible = visible_contact(press.difference, sensor)
    contact = _measured_contact(press.difference, press.measured, sensor)
    total = float(press.measured.sum())
    measured_radius, bulges = _measured_ball(press.measured, contact, sensor)
    row = {
        "found": press.found,
        "bulges": bulges,
        "felt_peak_mm": 1e3 * float(press.measured.max()),
        "felt_radius_mm": None if measured_radius is None else 1e3 * measured_radius,
        "roundness": _roundness(contact),
        "outside_share": float(press.measured[~visible].sum()) / total if total else 0.0,
        "iou": 0.0 if press.nearest is None else _iou(press.measured, cap_penetration(press.nearest, radius, sensor)),
    }
    return row | _against_ideal(press)


def _against_ideal(press: MeasuredPress) -> dict:
    if press.ideal is None:
        return dict.fromkeys(("ideal_peak_mm", "peak_ratio", "rmse_in_circle_mm", "iou_ideal", "centre_mm"))
    off, apart = (press.measured - press.ideal)[press.ideal > 0], None
    if press.nearest is not None:
        apart = 1e3 * float(np.linalg.norm((press.nearest - press.truth)[:2]))
    return {
        "ideal_peak_mm": 1e3 * float(press.ideal.max()),
        "peak_ratio": float(press.measured.max() / press.ideal.max()),
        "rmse_in_circle_mm": 1e3 * float(np.sqrt(np.mean(off**2))),
        "iou_ideal": _iou(press.measured, press.ideal),
        "centre_mm": apart,
    }


def _measured_ball(measured: np.ndarray, contact: np.ndarray, sensor: SensorModel) -> tuple[float | None, bool]:
    """Return the radius [m] of the sphere nearest to a contact's core, None unless it bulges, and whether it does."""
    inside = np.where(contact, measured, 0)
    core = _largest_region(inside > _CORE * inside.max()) if contact.any() else contact
    if core.sum() < _FEWEST:
        return None, False
    points = cloud_from_penetration(measured, core, sensor).astype(float)
    bulges = bool(principal_curvatures(points)[0] > 0)
    return (fit_sphere(points).radius if bulges else None), bulges


def _iou(measured: np.ndarray, cap: np.ndarray) -> float:
    """Return the intersection over union of two contacts (H, W) m."""
    claimed, there = measured >= TOUCHED, cap >= TOUCHED
    return float((claimed & there).sum() / max((claimed | there).sum(), 1))


def _summary(rows: list[dict], truth: str) -> dict:
    """Return fractions of all presses, medians of those with the figure, correlation of those with a true depth.

    recall: of contact detection; every press is a contact.
    """

    frame = pd.DataFrame(rows)
    medians = ["rmse_in_circle_mm", "peak_ratio", "felt_radius_mm", "iou", "iou_ideal", "centre_mm", "roundness"]
    known = frame.dropna(subset="ideal_peak_mm")
    return {
        "presses": len(rows),
        "labelled": truth == LABELS,
        "truth": truth,
        "recall": float(frame["found"].mean()),
        "bulges_share": float(frame["bulges"].mean()),
        "depth_correlation": _correlation(known[["ideal_peak_mm", "felt_peak_mm"]].to_numpy(float)),
        **frame[[*medians, "outside_share"]].astype(float).median().to_dict(),
    }


def _correlation(pairs: np.ndarray) -> float:
    """Return Pearson's correlation of pairs (N, 2) of peaks; nan for fewer than three, or if one never changes."""
    if len(pairs) < 3 or (np.ptp(pairs, axis=0) == 0).any():
        return float("nan")
    return float(np.corrcoef(np.transpose(pairs))[0, 1])


def _roundness(mask: np.ndarray) -> float:
    """Return the area over that of the smallest circle around it: 1 for a disc, 0 for nothing."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return 0.0
    _, radius = cv2.minEnclosingCircle(np.column_stack([columns, rows]).astype(np.float32))
    # the circle goes through pixel centres, the area counts whole pixels
    return float(min(1.0, len(rows) / (np.pi * (radius + 0.5) ** 2)))


def _largest_region(mask: np.ndarray) -> np.ndarray:
    """Return the largest connected region (H, W) bool of a mask; empty if the mask is."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    if len(stats) < 2:
        return np.zeros(mask.shape, bool)
    return labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
