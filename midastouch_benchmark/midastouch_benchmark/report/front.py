"""Run time against error: a point per variant, and the Pareto front."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from midastouch_bringup.drawing.figures import style_error_axes

from ..statistics.comparison import pareto_front, rows_by_init
from ..trials.variants import BUDGET, COUNT, DEFAULT, GATE, INPUT, MECHANISM, PAPER, PEER, PRESET
from .point_labels import label_points

_GROUPS = {
    DEFAULT: ("default, as shipped", "#cc1a73", "*"),
    PRESET: ("a preset", "#cc1a73", "d"),
    PAPER: ("the paper's filter", "black", "s"),
    PEER: ("another method", "#555555", "P"),
    COUNT: ("fewer particles", "#1f77b4", "o"),
    INPUT: ("fewer codebook poses, shorter codes", "#2a8f4e", "D"),
    BUDGET: ("fewer or more modes aligned", "#17a2b8", "X"),
    MECHANISM: ("a mechanism off", "#e08214", "v"),
    GATE: ("a gate off", "#7a4fb5", "^"),
}
_MARKED = {DEFAULT: 13, PRESET: 10}  # size of the marker
_ERRORS = {"e_trans_mm": "particles [mm]", "symmetric_e_trans_mm": "particles, modulo symmetry [mm]"}


def front_figure(comparison: list[dict], variants: dict[str, dict]) -> Figure:
    """Mean final error over the filter's CPU milliseconds per frame: a column per init, a row per error; the one modulo
    symmetry only where it differs. `comparison` as of `compare_variants`, `variants` their descriptions by name."""
    columns = rows_by_init(comparison)
    errors = [key for key in _ERRORS if key == "e_trans_mm" or any(row[key] != row["e_trans_mm"] for row in comparison)]
    figure = Figure(figsize=(7 * len(columns), 5.2 * len(errors)), layout="constrained")
    grid = figure.subplots(len(errors), len(columns), squeeze=False)
    for axes_of_error, error in zip(grid, errors, strict=True):
        for axes, (init, rows) in zip(axes_of_error, columns.items(), strict=True):
            _draw(axes, rows, error, variants)
            axes.set_title(f"start: {init}, {rows[0]['trials']} trials each", fontsize=10, loc="left")
    figure.legend(*_handles(grid.flat), loc="outside lower center", ncols=2 * len(columns), frameon=False, fontsize=9)
    figure.draw_without_rendering()  # where things lie is known only then
    for axes_of_error, error in zip(grid, errors, strict=True):
        for axes, rows in zip(axes_of_error, columns.values(), strict=True):
            label_points(axes, [(row["cpu_ms_filter"], row[error]) for row in rows], [row["variant"] for row in rows])
    return figure


def _draw(axes: Axes, rows: list[dict], error: str, variants: dict[str, dict]) -> None:
    front = pareto_front(rows, error)
    corners = [(row["cpu_ms_filter"], row[error]) for row in front]
    axes.plot(*zip(*corners, strict=True), color="#9aa1ab", lw=1.2, zorder=1, label="Pareto front")
    for group, (label, colour, marker) in _GROUPS.items():
        own = [row for row in rows if variants[row["variant"]]["group"] == group]
        if own:
            place = [row["cpu_ms_filter"] for row in own], [row[error] for row in own]
            axes.plot(
                *place,
                marker,
                color=colour,
                ms=_MARKED.get(group, 6),
                label=label,
                zorder=2 + (group in _MARKED),
            )
    style_error_axes(axes, f"mean final error of the {_ERRORS[error]}", "filter, CPU ms per frame")
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
