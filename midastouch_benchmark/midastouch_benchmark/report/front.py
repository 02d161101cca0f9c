"""Figure of error against run time: variants of the filter, each labelled, and the Pareto front."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from midastouch_tools.drawing.figures import style_error_axes

from ..statistics.comparison import pareto_front, rows_by_init
from ..trials.variants import BASELINE, BUDGET, DEFAULT, GATE, MECHANISM, PAPER, PRESET

_SIZE = 8  # pt
_WIDTH, _HEIGHT = 0.58 * _SIZE, 1.25 * _SIZE  # pt, of a character
_POINT = 5.0  # pt, half the size of a marker
_NEXT = 9.0  # pt, from a point to a label next to it
_DISTANCES, _ANGLES = np.arange(_NEXT, 160, 8), np.radians(np.arange(0, 360, 15))


def label_points(axes: Axes, points: list[tuple[float, float]], labels: list[str]) -> None:
    """Write labels at points in data coordinates, the first ones nearest; the figure must have been laid out. Each goes
    where there is room, preferably away from the crowd. A line joins a label to its point unless it is next to it."""
    scale = 72 / axes.figure.dpi
    where = scale * axes.transData.transform(np.array(points, float))
    frame = scale * np.array(axes.bbox.extents)
    crowd = np.median(where, axis=0)
    taken = [(*(point - _POINT), *(point + _POINT)) for point in where]
    for point, place, label in zip(points, where, labels, strict=True):
        box, offset, distance = _free_box(place, place - crowd, len(label) * _WIDTH, frame, taken)
        taken.append(box)
        line = {"arrowstyle": "-", "color": "#9aa1ab", "lw": 0.6, "shrinkA": 0, "shrinkB": 2}
        axes.annotate(
            label,
            point,
            (offset[0], offset[1]),
            textcoords="offset points",
            fontsize=_SIZE,
            va="bottom",
            arrowprops=line if distance > _NEXT else None,
        )


def _free_box(
    point: np.ndarray, outwards: np.ndarray, width: float, frame: np.ndarray, taken: list[tuple]
) -> tuple[tuple, np.ndarray, float]:
    """Return a free box (left, bottom, right, top), its corner's offset and its distance from the point; if none is
    free, the most preferred one within the frame."""
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


_GROUPS = {
    DEFAULT: ("default, as shipped", "#cc1a73", "*"),
    PRESET: ("a preset", "#cc1a73", "d"),
    PAPER: ("the paper's filter", "black", "s"),
    BASELINE: ("another method", "#555555", "P"),
    BUDGET: ("less or more work, fewer poses", "#17a2b8", "X"),
    MECHANISM: ("a mechanism off", "#e08214", "v"),
    GATE: ("a gate off", "#7a4fb5", "^"),
}
_MARKED = {DEFAULT: 13, PRESET: 10}  # size of the marker
_ERROR = "e_trans_mm"


def front_figure(comparison: list[dict], variants: dict[str, dict]) -> Figure:
    """Plot the mean final error over the filter's CPU milliseconds per frame, a column per init; comparison: rows of
    `compare_variants`; variants: their descriptions by name."""
    columns = rows_by_init(comparison)
    figure = Figure(figsize=(7 * len(columns), 5.2), layout="constrained")
    (grid,) = figure.subplots(1, len(columns), squeeze=False)
    for axes, (init, rows) in zip(grid, columns.items(), strict=True):
        _draw(axes, rows, variants)
        axes.set_title(f"start: {init}, {rows[0]['trials']} trials each", fontsize=10, loc="left")
    figure.legend(*_handles(grid), loc="outside lower center", ncols=2 * len(columns), frameon=False, fontsize=9)
    figure.draw_without_rendering()  # positions are known only after this
    for axes, rows in zip(grid, columns.values(), strict=True):
        label_points(axes, [(row["cpu_ms_filter"], row[_ERROR]) for row in rows], [row["variant"] for row in rows])
    return figure


def _draw(axes: Axes, rows: list[dict], variants: dict[str, dict]) -> None:
    front = pareto_front(rows, _ERROR)
    corners = [(row["cpu_ms_filter"], row[_ERROR]) for row in front]
    axes.plot(*zip(*corners, strict=True), color="#9aa1ab", lw=1.2, zorder=1, label="Pareto front")
    for group, (label, colour, marker) in _GROUPS.items():
        own = [row for row in rows if variants[row["variant"]]["group"] == group]
        if own:
            place = [row["cpu_ms_filter"] for row in own], [row[_ERROR] for row in own]
            axes.plot(
                *place, marker, color=colour, ms=_MARKED.get(group, 6), label=label, zorder=2 + (group in _MARKED)
            )
    style_error_axes(axes, "mean final error of the particles [mm]", "filter, CPU ms per frame")
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.margins(x=0.1, y=0.1)


def _handles(all_axes: np.ndarray) -> tuple[list, list[str]]:
    handles: dict[str, object] = {}
    for axes in all_axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    return list(handles.values()), list(handles)
