"""Figures of one run: overview as in the paper's figure 7, errors over time, probability of each object.

Everything is drawn on `matplotlib.figure.Figure` directly, which needs neither a display nor global state.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from midastouch_common.files import atomic_path
from midastouch_common.pose_metric import min_cluster_error, particle_rmse
from midastouch_filter.identification.identity import UNKNOWN
from midastouch_perception.codebook import Codebook

from ..bags.run_record import Snapshot
from .object_view import ObjectView
from .scale import draw_scale

PARTICLE_COLOUR, MODE_COLOUR, ESTIMATE_COLOUR = "#7a7f87", "#1f77b4", "#cc1a73"
PENETRATION_COLOURS = "viridis"
_CLOSER = 10
_TIME = "time since the first image [s]"
LEGEND = (
    "particles coloured by their angle to the truth, blue 0° to red 180°; green dot with large axes: truth; "
    "small axes with 2-sigma ellipse: modes"
)
"""Legend of pictures of the object with particles."""


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, whole or not at all."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=130)
    return path


def run_figure(view: ObjectView, codebook: Codebook, chosen: list[Snapshot], run: list[Snapshot], title: str) -> Figure:
    """A run at the chosen moments: touch, likelihood over the object, particles; below, the errors over time.

    The paper's figure 7. `run` holds every recorded frame, `chosen` the columns.
    """
    columns = len(chosen)
    shape = 3.1 * view.camera.height / view.camera.width + 0.25
    figure = Figure(figsize=(3.1 * columns, 4.9 + 2 * shape), layout="constrained")
    figure.suptitle(f"{title}\n{LEGEND}", fontsize=9)
    rows: Any = figure.subfigures(4, 1, height_ratios=[2.1, shape, shape, 2.8])
    deepest = max(1e-4, max(float(s.penetration.max()) for s in chosen))
    touches = _row(rows[0], 2 * columns)
    for axes, beside, snapshot in zip(touches[::2], touches[1::2], chosen, strict=True):
        axes.imshow(snapshot.image)
        axes.set_title(f"{snapshot.time:.1f} s   tactile image", fontsize=9, loc="left")
        shown = beside.imshow(1e3 * snapshot.penetration, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * deepest)
        beside.set_title("penetration", fontsize=9, loc="left")
    bar = rows[0].colorbar(shown, ax=rows[0].axes, location="right", fraction=0.012, pad=0.01)
    bar.set_label("mm", fontsize=9)
    for axes, snapshot in zip(_row(rows[1], columns), chosen, strict=True):
        axes.imshow(view.likelihood(codebook, snapshot))
        draw_scale(axes, view.camera)
        axes.set_title("likelihood of this touch, pale to red", fontsize=9, loc="left")
    for axes, snapshot in zip(_row(rows[2], columns), chosen, strict=True):
        axes.imshow(view.particles(snapshot))
        draw_scale(axes, view.camera)
        e_trans, e_rot = particle_rmse(snapshot.particles, snapshot.truth)
        label = f"particles: {1e3 * e_trans:.1f} mm, {np.degrees(e_rot):.1f}°, {snapshot.state}"
        axes.set_title(label, fontsize=9, loc="left")
    _draw_errors(rows[3].subplots(1, 2), run, [s.time for s in chosen])
    return figure


def final_figure(view: ObjectView, last: Snapshot, contact: np.ndarray) -> Figure:
    """Particles, modes and truth of one moment, with a legend and a scale; beside them, the measured `contact` (K, 3) m
    from above at ten times the size."""
    height = 9.6 * view.camera.height / view.camera.width
    figure = Figure(figsize=(9.6 + height, height + 0.8), layout="constrained")
    axes = figure.subplots(1, 2, width_ratios=(9.6, height))
    close_up, camera = view.close_up(last, contact, _CLOSER)
    for one, picture, seen_by in zip(axes, (view.particles(last), close_up), (view.camera, camera), strict=True):
        one.set_axis_off()
        one.imshow(picture)
        draw_scale(one, seen_by)
    axes[1].set_title(f"x {_CLOSER}: truth green, estimate magenta, contact orange", fontsize=9)
    figure.suptitle(f"{view.mesh.name} after {last.time:.1f} s: {last.state}\n{LEGEND}", fontsize=9)
    return figure


def identity_figure(run: list[Snapshot]) -> Figure:
    """Probability of each object that may be touched, over time."""
    figure = Figure(figsize=(10, 2.6), layout="constrained")
    axes = figure.subplots()
    for name in dict.fromkeys(name for snapshot in run for name in snapshot.objects):
        percent = [100 * snapshot.objects.get(name, 0.0) for snapshot in run]
        axes.step(
            [s.time for s in run],
            percent,
            where="post",
            lw=1.6,
            label=name,
            color="#7a7f87" if name == UNKNOWN else None,
        )
    style_axes(axes, "probability [%]")
    axes.set_ylim(-3, 103)
    axes.legend(frameon=False, fontsize=9)
    return figure


def _row(subfigure, columns: int) -> list:
    axes = np.atleast_1d(subfigure.subplots(1, columns))
    for one in axes:
        one.set_axis_off()
    return list(axes)


def error_series(run: list[Snapshot]) -> dict[str, np.ndarray]:
    """Return the errors (2, N) [mm, deg] of "particles", "closest mode" and "published pose" by these names, and
    "time" (N,) [s]."""
    series: dict[str, list] = {"particles": [], "closest mode": [], "published pose": []}
    for snapshot in run:
        series["particles"].append(particle_rmse(snapshot.particles, snapshot.truth))
        modes = np.array([mode.pose for mode in snapshot.modes]).reshape(-1, 4, 4)
        series["closest mode"].append(min_cluster_error(modes, snapshot.truth))
        estimate = np.zeros((0, 4, 4)) if snapshot.estimate is None else snapshot.estimate[None]
        series["published pose"].append(min_cluster_error(estimate, snapshot.truth))
    scale = np.array([[1e3], [180 / np.pi]])
    out = {name: scale * np.array(values).reshape(-1, 2).T for name, values in series.items()}
    out["time"] = np.array([s.time for s in run])
    return out


def _draw_errors(axes, run: list[Snapshot], marks: list[float]) -> None:
    series = error_series(run)
    styles = {
        "particles": {"color": PARTICLE_COLOUR, "lw": 2.2},
        "closest mode": {"color": MODE_COLOUR, "lw": 5, "alpha": 0.35},  # mostly the same as the next
        "published pose": {"color": ESTIMATE_COLOUR, "lw": 1.2},
    }
    for k, (one, label) in enumerate(zip(axes, ("translation error [mm]", "rotation error [deg]"), strict=True)):
        for name, style in styles.items():
            one.plot(series["time"], series[name][k], label=name, **style)
        for mark in marks:
            one.axvline(mark, color="#c8ccd2", lw=1, zorder=0)
        style_error_axes(one, label)
    axes[1].legend(frameon=False, fontsize=9)


def style_error_axes(axes, label: str, x_label: str = _TIME) -> None:
    """Style a logarithmic error axis: plain numbers, light grid, no box."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    style_axes(axes, label, x_label)


def style_axes(axes, label: str, x_label: str = _TIME) -> None:
    """Style axes: light grid, no box."""
    axes.set_xlabel(x_label, fontsize=9)
    axes.set_ylabel(label, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(which="both", color="#eceef1", lw=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
