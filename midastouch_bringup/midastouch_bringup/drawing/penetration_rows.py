"""Touches beside each other: image, its difference to the no-contact image, and reliefs on one colour scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.tdn import DepthNet

from .figures import PENETRATION_COLOURS

_ACROSS = 2  # touches side by side
_SHALLOW = 1e-4  # m: the scale ends there at least


class ReliefRow(NamedTuple):
    """One touch: name; image (H, W, 3) uint8 RGB; change (h, w, 3) grey levels; reliefs (h, w) m."""

    name: str
    image: np.ndarray
    change: np.ndarray
    reliefs: tuple[np.ndarray, ...]


def felt_with(
    tdn: DepthNet, calibration: SensorCalibration | None, image: np.ndarray, background: np.ndarray
) -> np.ndarray:
    """Penetration (h, w) m that the network feels in an image (H, W, 3) uint8 RGB with that calibration, or none."""
    tdn.calibration = calibration
    return tdn.predict(image, background)


def relief_figure(rows: Sequence[ReliefRow], titles: Sequence[str]) -> Figure:
    """All touches, two a line; titles: of the reliefs."""
    deepest = max(_SHALLOW, *(float(relief.max()) for row in rows for relief in row.reliefs))
    cells_each, lines = 2 + len(titles), -(-len(rows) // _ACROSS)
    figure = Figure(figsize=(1.4 * cells_each * _ACROSS, 2.1 * lines + 0.4), layout="constrained")
    axes = figure.subplots(lines, cells_each * _ACROSS, squeeze=False)
    for one in axes.ravel():
        one.set_axis_off()
    for k, row in enumerate(rows):
        cells = axes[k // _ACROSS, cells_each * (k % _ACROSS) :][:cells_each]
        cells[0].imshow(row.image)
        cells[1].imshow(np.clip(128 + row.change, 0, 255).astype(np.uint8))
        for cell, relief in zip(cells[2:], row.reliefs, strict=True):
            mapped = cell.imshow(1e3 * relief, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * deepest)
        for cell, title in zip(cells, (row.name, "difference", *titles), strict=True):
            cell.set_title(title, fontsize=8, loc="left")
    bar = figure.colorbar(mapped, ax=axes, location="right", fraction=0.012, pad=0.01)
    bar.set_label("penetration [mm]", fontsize=9)
    return figure
