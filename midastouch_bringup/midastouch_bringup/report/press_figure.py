"""Pictures of real presses: image, difference to the background, felt relief, the ball fitted to it."""

from __future__ import annotations

import dataclasses

import numpy as np
from matplotlib.figure import Figure

from .figures import PENETRATION_COLOURS

_ACROSS = 2  # presses side by side
_TITLES = ("image", "difference", "felt", "ball fitted")


@dataclasses.dataclass(frozen=True)
class PressPicture:
    """name; image (H, W, 3) uint8; difference (h, w, 3) grey levels; felt and fitted (h, w) m, fitted None without."""

    name: str
    image: np.ndarray
    difference: np.ndarray
    felt: np.ndarray
    fitted: np.ndarray | None


def press_figure(presses: list[PressPicture]) -> Figure:
    """Four pictures a press, two presses a row; one colour scale of penetration for all."""
    rows = -(-len(presses) // _ACROSS)
    figure = Figure(figsize=(12, 2.1 * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, 4 * _ACROSS, squeeze=False)
    for one in axes.ravel():
        one.set_axis_off()
    deepest = max(1e-4, max(float(press.felt.max()) for press in presses))
    for k, press in enumerate(presses):
        four = axes[k // _ACROSS, 4 * (k % _ACROSS) :][:4]
        four[0].imshow(press.image)
        four[1].imshow(np.clip(128 + press.difference, 0, 255).astype(np.uint8))
        for cell, relief in zip(four[2:], (press.felt, press.fitted), strict=True):
            if relief is not None:
                shown = cell.imshow(1e3 * relief, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * deepest)
        for cell, title in zip(four, (press.name, *_TITLES[1:]), strict=True):
            cell.set_title(title, fontsize=8, loc="left")
    bar = figure.colorbar(shown, ax=axes, location="right", fraction=0.012, pad=0.01)
    bar.set_label("penetration [mm]", fontsize=9)
    return figure


def radius_figure(rows: list[dict]) -> Figure:
    """Fitted radius and ratio of the principal curvatures of every press that has them."""
    fitted = [row for row in rows if row["radius_mm"] is not None]
    figure = Figure(figsize=(10, 3), layout="constrained")
    columns = (("radius_mm", "radius [mm]"), ("curvature_ratio", "smaller / larger curvature"))
    for axes, (key, label) in zip(figure.subplots(1, 2), columns, strict=True):
        axes.plot([row["deepest_mm"] for row in fitted], [row[key] for row in fitted], "o", ms=4, color="#1f77b4")
        axes.set_xlabel("deepest penetration [mm]", fontsize=9)
        axes.set_ylabel(label, fontsize=9)
        axes.set_ylim(0, None)
        axes.grid(color="#eceef1", lw=0.7)
    return figure
