"""Figures over trials: errors over the frames, final errors."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from midastouch_tools.drawing.figures import ESTIMATE_COLOUR, MODE_COLOUR, PARTICLE_COLOUR, style_error_axes

_ESTIMATES = (
    ("e", "particles", PARTICLE_COLOUR),
    ("min_cluster", "closest mode", MODE_COLOUR),
    ("estimate", "published pose", ESTIMATE_COLOUR),
)
_ERRORS = {"trans_mm": "translation error [mm]", "rot_deg": "rotation error [deg]"}


def trial_error_figure(title: str, trials: list[dict]) -> Figure:
    """Plot the median and the quartiles of the errors over the frames, from the trials of one sequence.

    trials: as in the `evaluate` JSON. This is the right part of the paper's figures 7, 21, 22.
    """
    figure = Figure(figsize=(10, 3.2), layout="constrained")
    figure.suptitle(title, fontsize=11)
    for axes, (key, label) in zip(figure.subplots(1, 2), _ERRORS.items(), strict=True):
        frames = trials[0]["per_frame"]["frame"]
        for prefix, name, colour in _ESTIMATES:
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
    for axes, (key, label) in zip(figure.subplots(2, 1), _ERRORS.items(), strict=True):
        for k, (prefix, name, colour) in enumerate(_ESTIMATES):
            errors = [[t["final"][f"{prefix}_{key}"] for t in trials if t["object"] == each] for each in objects]
            axes.boxplot(
                [[error for error in some if error is not None] for some in errors],
                positions=np.arange(len(objects)) + 0.24 * (k - 1),
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
