"""Pictures of real presses: image, difference to the background, felt relief, and what should be felt."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from midastouch_bringup.drawing.figures import PENETRATION_COLOURS

from ..perception.press_quality import Press

_ACROSS = 2  # presses side by side
_TITLES = ("image", "difference", "felt", "ideal")


def press_figure(presses: list[Press]) -> Figure:
    """Four pictures a press, two presses a row; one colour scale of penetration for all."""
    rows = -(-len(presses) // _ACROSS)
    figure = Figure(figsize=(12, 2.1 * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, 4 * _ACROSS, squeeze=False)
    for one in axes.ravel():
        one.set_axis_off()
    deepest = max(1e-4, *(float(map_.max()) for p in presses for map_ in (p.felt, p.ideal) if map_ is not None))
    for k, press in enumerate(presses):
        four = axes[k // _ACROSS, 4 * (k % _ACROSS) :][:4]
        four[0].imshow(press.image)
        four[1].imshow(np.clip(128 + press.difference, 0, 255).astype(np.uint8))
        for cell, relief in zip(four[2:], (press.felt, press.ideal), strict=True):
            if relief is not None:
                shown = cell.imshow(1e3 * relief, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * deepest)
        for cell, title in zip(four, (press.name, *_TITLES[1:]), strict=True):
            cell.set_title(title, fontsize=8, loc="left")
    bar = figure.colorbar(shown, ax=axes, location="right", fraction=0.012, pad=0.01)
    bar.set_label("penetration [mm]", fontsize=9)
    return figure


def depth_figure(content: dict) -> Figure:
    """Felt over pressed depth, and the radius felt, of every press of an `evaluate-presses` result, with the truth."""
    known = [row for row in content["presses"] if row["ideal_peak_mm"] is not None]
    figure = Figure(figsize=(10, 3), layout="constrained")
    depth, radius = figure.subplots(1, 2)
    pressed = [row["ideal_peak_mm"] for row in known]
    depth.plot(pressed, [row["felt_peak_mm"] for row in known], "o", ms=4, color="#1f77b4")
    depth.plot([0, max(pressed, default=1)], [0, max(pressed, default=1)], color="#2ca02c", lw=1)
    depth.set_ylabel("deepest felt [mm]", fontsize=9)
    round_ones = [row for row in known if row["felt_radius_mm"] is not None]
    felt = [row["felt_radius_mm"] for row in round_ones]
    radius.plot([row["ideal_peak_mm"] for row in round_ones], felt, "o", ms=4, color="#1f77b4")
    radius.axhline(500 * content["ball_diameter"], color="#2ca02c", lw=1)
    radius.set_ylabel("radius felt [mm]", fontsize=9)
    for axes in (depth, radius):
        axes.set_xlabel("pressed [mm]", fontsize=9)
        axes.set_ylim(0, None)
        axes.grid(color="#eceef1", lw=0.7)
    return figure
