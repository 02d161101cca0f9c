"""Pictures of results: errors over frames, final errors, error against run time, presses of a ball, single touches."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_tools.datasets.ball_presses import load_ball_presses
from midastouch_tools.drawing.calibration import PenetrationRow, penetration_figure
from midastouch_tools.drawing.figures import (
    ESTIMATE_COLOUR,
    MODE_COLOUR,
    PARTICLE_COLOUR,
    style_error_axes,
)
from midastouch_tools.drawing.object_view import ObjectView

from ..perception.press_quality import MeasuredPress, as_measured
from ..perception.press_truth import calibrations_of, usable_presses, with_truth
from ..statistics.comparison import pareto_front, rows_by_init
from ..trials.variants import BASELINE, BUDGET, DEFAULT, GATE, MECHANISM, PAPER, PRESET

Pictures = Iterator[tuple[str, str, Figure | np.ndarray] | str]
"""End of the file's name, caption, and a figure or RGB (H, W, 3) uint8; a text says why a picture is missing."""


_ESTIMATES = (
    ("e", "particles", PARTICLE_COLOUR),
    ("min_cluster", "closest mode", MODE_COLOUR),
    ("estimate", "published pose", ESTIMATE_COLOUR),
)
_FEWEST_OF_A_BOX = 5  # trials; fewer are drawn as points
_ERRORS = {"trans_mm": "translation error [mm]", "rot_deg": "rotation error [deg]"}


def trial_error_figure(title: str, trial: dict) -> Figure:
    """Plot the errors over the frames of one sequence: the right part of the paper's figures 7, 21, 22.

    trial: as in the `evaluate` JSON.
    """
    figure = Figure(figsize=(10, 3.2), layout="constrained")
    figure.suptitle(title, fontsize=11)
    columns = trial["per_frame"]
    for axes, (key, label) in zip(figure.subplots(1, 2), _ERRORS.items(), strict=True):
        for prefix, name, colour in _ESTIMATES:
            axes.plot(columns["frame"], np.array(columns[f"{prefix}_{key}"], float), color=colour, lw=1.6, label=name)
        style_error_axes(axes, label, "frame")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=9)
    return figure


def final_error_figure(trials: list[dict]) -> Figure:
    """Draw box plots per object of the final errors of particles, closest mode and published pose: the paper's figures
    8 and 20."""
    objects = sorted({t["object"] for t in trials})
    figure = Figure(figsize=(max(6.0, 1.5 * len(objects) + 3), 7), layout="constrained")
    for axes, (key, label) in zip(figure.subplots(2, 1), _ERRORS.items(), strict=True):
        for k, (prefix, name, colour) in enumerate(_ESTIMATES):
            errors = [[t["final"][f"{prefix}_{key}"] for t in trials if t["object"] == each] for each in objects]
            errors = [[error for error in some if error is not None] for some in errors]
            places = np.arange(len(objects)) + 0.24 * (k - 1)
            if max(map(len, errors)) < _FEWEST_OF_A_BOX:
                points = [(x, error) for x, some in zip(places, errors, strict=True) for error in some]
                axes.plot(*np.reshape(points, (-1, 2)).T, "o", color=colour, label=name)
                continue
            axes.boxplot(
                errors,
                positions=places,
                widths=0.2,
                patch_artist=True,
                boxprops={"facecolor": colour, "alpha": 0.55, "lw": 0},
                medianprops={"color": "black"},
                flierprops={"marker": ".", "markersize": 4, "markeredgecolor": colour},
                manage_ticks=False,
                label=name,
            )
        style_error_axes(axes, f"final {label}", "")
        axes.set_xticks(np.arange(len(objects)), objects, fontsize=9)
    axes.legend(frameon=False, fontsize=9)
    return figure


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
    handles = {label: handle for axes in grid for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(
        handles.values(), handles, loc="outside lower center", ncols=2 * len(columns), frameon=False, fontsize=9
    )
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


_SHOWN = 12


def press_pictures(content: dict) -> Pictures:
    """Yield name, caption and figure of some presses of a result; a text says why they are missing."""
    try:
        rows = [PenetrationRow(p.name, p.image, p.difference, (p.measured, p.ideal)) for p in _shown(content)]
        yield "", f"Presses of {content['folder']}", penetration_figure(rows, ("measured", "ideal"))
    except InputError as error:
        yield f"no pictures of the presses: {error}"


def _shown(content: dict) -> list[MeasuredPress]:
    """Measure `_SHOWN` presses again with the network of the result; InputError if it or the images are gone."""
    sensor = SensorModel.load(content["sensor"])
    if content["px_per_mm"]:
        sensor = sensor.at_scale(1e3 * content["px_per_mm"])
    tdn = load_tdn(content["tdn"], sensor)
    if tdn.network_id != content["network"]:
        raise InputError(f"the network is now {tdn.network_id}; measure them again")
    presses, _ = usable_presses(load_ball_presses(content["folder"]), sensor)
    names = list(presses.images)
    some = np.unique(np.linspace(0, len(names) - 1, _SHOWN).round().astype(int))
    calibrations = calibrations_of(content, presses, sensor)
    known, *_ = with_truth(presses, content["ball_diameter"], sensor)
    shown = known.only([names[k] for k in some])
    return list(as_measured(tdn, shown, content["ball_diameter"] / 2, calibrations))


_ERROR_COLOURS = colormaps["RdYlBu_r"]
_VIEW_WIDTH = 420


def single_touch_pictures(content: dict) -> Pictures:
    """Yield name, caption and picture of each picture of a `single-touch` result; a text says why one is missing."""
    objects = sorted(content["objects"], key=lambda one: one["summary"]["normalised_top25_error"])
    yield "", "Error over that of random touches, best object first; bars: median", violin_figure(objects)
    for one in objects:
        if not (one["mesh"] and Path(one["mesh"]).is_file()):
            yield f"{one['object']}: no picture, the mesh {one['mesh']} is not there"
            continue
        caption = f"{one['object']}: where a touch tells the place (blue) and where it does not (red), means over 5 mm"
        picture = error_picture(overview(ObjectMesh.load(one["mesh"]), _VIEW_WIDTH), np.array(one["cells"], float))
        yield f"_{one['object']}", caption, picture


def overview(mesh: ObjectMesh, width: int) -> ObjectView:
    """Return a view of the mesh from the side that shows most of its surface."""
    points, normals, _ = mesh.sample_surface(400, np.random.default_rng(0))
    return ObjectView(mesh, se3.make(se3.frame_from_normal(normals, np.zeros(len(normals))), points), width)


def error_picture(view: ObjectView, cells: np.ndarray) -> np.ndarray:
    """Paint the mean error by place, rows (C, 8) of `CELL_COLUMNS`, on the object, blue 0 to red 1; (H, W, 3) uint8."""
    error, touches = cells[:, 6], cells[:, 7]

    def colours(sums: np.ndarray) -> np.ndarray:
        return _ERROR_COLOURS(np.clip(sums[:, 0] / sums[:, 1], 0, 1))[:, :3]

    return view.painted(1e-3 * cells[:, :3], cells[:, 3:6], np.stack([error * touches, touches], axis=1), colours)


def violin_figure(objects: list[dict]) -> Figure:
    """Plot the distribution of the normalised top-25 error of each object, by its `errors`."""
    figure = Figure(figsize=(max(5.0, 1.15 * len(objects) + 1.5), 3.8), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(objects)) + 1.0
    errors = [one["errors"] for one in objects]
    drawn = axes.violinplot(errors, places, widths=0.85, showextrema=False, showmedians=True)
    for body in drawn["bodies"]:  # type: ignore[attr-defined] # it is a list
        body.set(facecolor=MODE_COLOUR, alpha=0.65, linewidth=0)
    axes.axhline(1.0, color=PARTICLE_COLOUR, lw=1, ls="--")
    axes.set_xticks(places, [one["object"] for one in objects], fontsize=8, rotation=20, ha="right")
    axes.set_ylabel("top-25 pose error / random touches", fontsize=9)
    axes.tick_params(axis="y", labelsize=8)
    axes.set_ylim(0, max(1.5, *(np.percentile(some, 99.5) for some in errors)))
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def _evaluation(content: dict) -> Pictures:
    yield ("", "Final errors over all trials", final_error_figure(content["trials"]))
    for sequence in content["sequences"]:
        name = sequence["sequence"]
        own = next(t for t in content["trials"] if t["sequence"] == name)
        stem = re.sub(r"[^0-9A-Za-z]+", "_", name)
        figure = trial_error_figure(name, own)
        yield (f"_{stem}_errors", f"{name}, init {content['config']['init']}: errors over the frames", figure)
        if Path(sequence["mesh"]).is_file():
            caption = "true path (green) and published poses of the second half (red)"
            yield (f"_{stem}_paths", f"{name}: {caption}", _paths(sequence, own))
        else:
            yield f"no picture of the paths: the mesh {sequence['mesh']} is not there"


def _paths(sequence: dict, trial: dict) -> np.ndarray:
    """Draw the true path and the published poses on the mesh, (H, W, 3) uint8."""
    truth = se3.from_xyzquat(np.array(sequence["truth"]))
    known = [row for row in trial["per_frame"]["estimate"] if row is not None]
    # only the second half: in the first the filter still searches
    estimates = [se3.from_xyzquat(np.array(known[len(known) // 2 :]))] if known else []
    return ObjectView(ObjectMesh.load(sequence["mesh"]), truth, 900).paths(truth, estimates)


def _benchmark(content: dict) -> Pictures:
    for init in content["summary"].get(DEFAULT, {}):
        trials = [t for t in content["trials"] if t["variant"] == DEFAULT and t["init"] == init]
        yield (f"_{init}_errors", f"Start {init}: final errors", final_error_figure(trials))
    if len(content["variants"]) > 1 and content["comparison"]:
        caption = "Error against the filter's CPU time per frame; the line joins what no other variant beats in both"
        yield ("_front", caption, front_figure(content["comparison"], content["variants"]))


PICTURES: dict[str, Callable[[dict], Pictures]] = {
    "evaluate": _evaluation,
    "benchmark": _benchmark,
    "evaluate-perception presses": press_pictures,
    "single-touch": single_touch_pictures,
}
"""Pictures of a result, by the kind of experiment."""
