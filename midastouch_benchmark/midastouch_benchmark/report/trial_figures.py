"""Figures over trials: errors over the frames, box plots of the final errors, times per stage."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from midastouch_tools.drawing.figures import ESTIMATE_COLOUR, MODE_COLOUR, PARTICLE_COLOUR, style_error_axes


def trial_error_figure(title: str, trials: list[dict]) -> Figure:
    """Plot the median and the quartiles of the errors over the frames, from the trials of one sequence.

    trials: as in the `evaluate` JSON. This is the right part of the paper's figures 7, 21, 22.
    """
    figure = Figure(figsize=(10, 3.2), layout="constrained")
    figure.suptitle(title, fontsize=11)
    for axes, key, label in zip(
        figure.subplots(1, 2),
        ("trans_mm", "rot_deg"),
        ("translation error [mm]", "rotation error [deg]"),
        strict=True,
    ):
        frames = trials[0]["per_frame"]["frame"]
        for prefix, name, colour in (
            ("e", "particles", PARTICLE_COLOUR),
            ("min_cluster", "closest mode", MODE_COLOUR),
            ("estimate", "published pose", ESTIMATE_COLOUR),
        ):
            rows = np.array([t["per_frame"][f"{prefix}_{key}"] for t in trials], float)
            low, middle, high = np.nanpercentile(rows, [25, 50, 75], axis=0)
            axes.plot(frames, middle, color=colour, lw=1.6, label=name)
            axes.fill_between(frames, low, high, color=colour, alpha=0.15, lw=0)
        style_error_axes(axes, label, "frame")
    axes.legend(frameon=False, fontsize=9, title=f"median and quartiles, {len(trials)} trials", title_fontsize=8)
    return figure


def final_error_figure(trials: list[dict]) -> Figure:
    """Draw box plots per object of the final errors of particles, closest mode and published pose: the paper's figures
    8 and 20."""
    objects = sorted({t["object"] for t in trials})
    figure = Figure(figsize=(max(6.0, 1.5 * len(objects) + 3), 7), layout="constrained")
    for axes, key, label in zip(
        figure.subplots(2, 1),
        ("trans_mm", "rot_deg"),
        ("final translation error [mm]", "final rotation error [deg]"),
        strict=True,
    ):
        for shift, prefix, name, colour in (
            (-0.24, "e", "particles", PARTICLE_COLOUR),
            (0.0, "min_cluster", "closest mode", MODE_COLOUR),
            (0.24, "estimate", "published pose", ESTIMATE_COLOUR),
        ):
            values = [_finite(t["final"][f"{prefix}_{key}"] for t in trials if t["object"] == o) for o in objects]
            axes.boxplot(
                values,
                positions=np.arange(len(objects)) + shift,
                widths=0.2,
                patch_artist=True,
                boxprops={"facecolor": colour, "alpha": 0.55, "lw": 0},
                medianprops={"color": "black"},
                flierprops={"marker": ".", "markersize": 4, "markeredgecolor": colour},
                manage_ticks=False,
                label=name,
            )
        style_error_axes(axes, label, "")
        axes.set_xticks(np.arange(len(objects)), objects, fontsize=9)
    axes.legend(frameon=False, fontsize=9)
    return figure


def _finite(values) -> list[float]:
    return [v for v in values if v is not None]


def stage_figure(speed: dict) -> Figure:
    """Plot the milliseconds per stage of a `bench` JSON: wall p50 and p95, and CPU time."""
    names, rows = [], []
    for key, label in (
        ("tdn_ms", "TDN"),
        ("tcn_ms", "TCN"),
        ("filter_ms", "filter"),
        ("deferred_ms", "after the answer"),
        ("align_ms", "alignment"),
        ("lookup_ms", "look-up"),
    ):
        stage = speed.get(key, {})
        if "p50" in stage:
            names.append(label)
            rows.append(stage)
        else:
            names += [f"{label}, {state}" for state in stage]
            rows += stage.values()
    figure = Figure(figsize=(9, 0.45 * len(names) + 1.4), layout="constrained")
    axes = figure.subplots()
    y = np.arange(len(names))[::-1]
    axes.barh(y, [r["p95"] for r in rows], height=0.6, color="#d5dbe3", label="p95")
    axes.barh(y, [r["p50"] for r in rows], height=0.6, color=MODE_COLOUR, alpha=0.8, label="p50")
    axes.plot([r["cpu"] for r in rows], y, "k|", ms=14, mew=2, label="CPU time")
    axes.set_yticks(y, names, fontsize=9)
    axes.set_xlabel("ms per call", fontsize=9)
    axes.legend(frameon=False, fontsize=9)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure
