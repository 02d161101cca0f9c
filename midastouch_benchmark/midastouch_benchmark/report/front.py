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
_CROWDED = 1e4  # cost of a box that overlaps, over that of the farthest one
_DISTANCES, _ANGLES = np.arange(_NEXT, 160, 8), np.radians(np.arange(0, 360, 15))


def label_points(axes: Axes, points: list[tuple[float, float]], labels: list[str]) -> None:
    """Write labels at points in data coordinates, the first ones nearest; the figure must have been laid out. Each goes
    where there is room, preferably away from the crowd. A line joins a label to its point unless it is next to it."""
    scale = 72 / axes.figure.dpi
    where = scale * axes.transData.transform(np.array(points, float))
    low, high = scale * np.array(axes.bbox.extents).reshape(2, 2)
    distance, angle = (grid.ravel() for grid in np.meshgrid(_DISTANCES, _ANGLES))
    ways = distance[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    taken = np.hstack([where - _POINT, where + _POINT])  # left, bottom, right, top
    for point, place, label in zip(points, where, labels, strict=True):
        size = np.array([len(label) * _WIDTH, _HEIGHT])
        # the side of the box that faces the point lies at the distance
        offsets = ways - np.column_stack([np.where(ways[:, 0] > -1e-9, 0.0, size[0]), np.full(len(ways), size[1] / 2)])
        boxes = np.hstack([place + offsets, place + offsets + size])
        inside = (boxes[:, :2] > low).all(axis=1) & (boxes[:, 2:] < high).all(axis=1)
        overlap = np.all((boxes[:, None, :2] < taken[:, 2:]) & (taken[:, :2] < boxes[:, None, 2:]), axis=2)
        outwards = np.arctan2(*(place - np.median(where, axis=0))[::-1])
        cost = distance * (2 - np.cos(angle - outwards)) + _CROWDED * np.any(overlap, axis=1)
        best = int(np.argmin(np.where(inside, cost, np.inf)))
        taken = np.vstack([taken, boxes[best]])
        line = {"arrowstyle": "-", "color": "#9aa1ab", "lw": 0.6, "shrinkA": 0, "shrinkB": 2}
        axes.annotate(
            label, point, tuple(offsets[best]), textcoords="offset points", fontsize=_SIZE, va="bottom",
            arrowprops=line if distance[best] > _NEXT else None,
        )  # fmt: skip


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
