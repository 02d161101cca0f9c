"""Labels beside points, placed so that they cover neither points nor each other."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

_SIZE = 8  # pt
_WIDTH, _HEIGHT = 0.58 * _SIZE, 1.25 * _SIZE  # pt, of a character
_POINT = 5.0  # pt, half of what a marker takes
_NEXT = 9.0  # pt, of a label beside its point
_DISTANCES, _ANGLES = np.arange(_NEXT, 160, 8), np.radians(np.arange(0, 360, 15))


def label_points(axes: Axes, points: list[tuple[float, float]], labels: list[str]) -> None:
    """Write labels at points in data coordinates, the first ones nearest: each where there is room, rather away from
    the crowd, and joined by a line where it is not next to its point. The figure must have been laid out."""
    scale = 72 / axes.figure.dpi
    where = scale * axes.transData.transform(np.array(points, float))
    frame = scale * axes.bbox.extents
    crowd = np.median(where, axis=0)
    taken = [(*(point - _POINT), *(point + _POINT)) for point in where]
    for point, place, label in zip(points, where, labels, strict=True):
        box, offset, distance = _free_box(place, place - crowd, len(label) * _WIDTH, frame, taken)
        taken.append(box)
        line = {"arrowstyle": "-", "color": "#9aa1ab", "lw": 0.6, "shrinkA": 0, "shrinkB": 2}
        axes.annotate(
            label,
            point,
            offset,
            textcoords="offset points",
            fontsize=_SIZE,
            va="bottom",
            arrowprops=line if distance > _NEXT else None,
        )


def _free_box(
    point: np.ndarray, outwards: np.ndarray, width: float, frame: np.ndarray, taken: list[tuple]
) -> tuple[tuple, np.ndarray, float]:
    """A box (left, bottom, right, top) that is free, its corner's offset and its distance from the point; where none is
    free, the likeliest one within the frame."""
    distance, angle = (grid.ravel() for grid in np.meshgrid(_DISTANCES, _ANGLES))
    away = np.cos(angle - np.arctan2(outwards[1], outwards[0]))
    boxes = []
    for k in np.argsort(distance * (2 - away), kind="stable"):
        x, y = distance[k] * np.cos(angle[k]), distance[k] * np.sin(angle[k])
        # the side of the box that faces the point lies at the distance
        offset = np.array([x if x > -1e-9 else x - width, y - _HEIGHT / 2])
        left, bottom = point + offset
        box = left, bottom, left + width, bottom + _HEIGHT
        if left > frame[0] and bottom > frame[1] and box[2] < frame[2] and box[3] < frame[3]:
            boxes.append((box, offset, distance[k]))
            if not any(_overlap(box, other) for other in taken):
                return boxes[-1]
    return boxes[0] if boxes else ((*point, *point), np.zeros(2), 0.0)


def _overlap(a: tuple, b: tuple) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
