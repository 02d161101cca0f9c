"""Figure of error against run time: variants of the filter, and the Pareto front with its names."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from midastouch_tools.drawing.figures import style_error_axes

from ..statistics.comparison import pareto_front, rows_by_init
from ..trials.variants import BASELINE, BUDGET, DEFAULT, GATE, MECHANISM, PAPER, PRESET

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
    return figure


def _draw(axes: Axes, rows: list[dict], variants: dict[str, dict]) -> None:
    front = pareto_front(rows, _ERROR)
    corners = [(row["cpu_ms_filter"], row[_ERROR]) for row in front]
    axes.plot(*zip(*corners, strict=True), color="#9aa1ab", lw=1.2, zorder=1, label="Pareto front")
    # the others, which may lie in a crowd, are named in the table
    for row in [*front, *(row for row in rows if row["variant"] == DEFAULT and row not in front)]:
        at = row["cpu_ms_filter"], row[_ERROR]
        axes.annotate(row["variant"], at, (5, 5), textcoords="offset points", fontsize=8)
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
