"""Figure of touches before and after a calibration, and the page that shows every press of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from midastouch_common.files import whole_folder
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_calibration.fit import Result
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet, load_tdn

from .figures import PENETRATION_COLOURS, save
from .page import Page

_ACROSS = 2  # touches side by side
_SHALLOW = 1e-4  # m: least end of the scale


class PenetrationRow(NamedTuple):
    """One touch: name; image (H, W, 3) uint8 RGB; change (h, w, 3) grey levels; penetrations (h, w) m, or None."""

    name: str
    image: np.ndarray
    change: np.ndarray
    penetrations: tuple[np.ndarray | None, ...]


def measured_with(
    tdn: DepthNet, calibration: SensorCalibration | None, image: np.ndarray, background: np.ndarray
) -> np.ndarray:
    """Give the network that calibration, or none; return the penetration (h, w) m of an image (H, W, 3) uint8 RGB."""
    tdn.calibration = calibration
    return tdn.predict(image, background)


def penetration_figure(rows: Sequence[PenetrationRow], titles: Sequence[str]) -> Figure:
    """Draw all touches, two per line; titles: of the penetration maps."""
    deepest = max(_SHALLOW, *(float(one.max()) for row in rows for one in row.penetrations if one is not None))
    cells_each, lines = 2 + len(titles), -(-len(rows) // _ACROSS)
    figure = Figure(figsize=(_ACROSS * (cells_each + 2), 2.1 * lines + 0.4), layout="constrained")
    axes = figure.subplots(lines, cells_each * _ACROSS, squeeze=False)
    for one in axes.ravel():
        one.set_axis_off()
    for k, row in enumerate(rows):
        cells = axes[k // _ACROSS, cells_each * (k % _ACROSS) :][:cells_each]
        cells[0].imshow(row.image)
        cells[1].imshow(np.clip(128 + row.change, 0, 255).astype(np.uint8))
        for cell, penetration in zip(cells[2:], row.penetrations, strict=True):
            if penetration is not None:
                mapped = cell.imshow(1e3 * penetration, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * deepest)
        for cell, title in zip(cells, (row.name, "difference", *titles), strict=True):
            cell.set_title(title, fontsize=8, loc="left")
    bar = figure.colorbar(mapped, ax=axes, location="right", fraction=0.012, pad=0.01)
    bar.set_label("penetration [mm]", fontsize=9)
    return figure


TITLES = "measured before", "measured after", "truth"
"""Titles of the penetration maps of a touch."""
_MOST_SHOWN = 20
_PICTURE = "presses.png"


def calibration_page(result: Result, images: dict[str, np.ndarray], sensor: SensorModel, folder: Path) -> Path:
    """Write `index.html` and its picture into a folder, both at once; returns the page's path.

    images (320, 240, 3) uint8 RGB: by name, those from which `result` was made; sensor: full size.
    """
    calibration = result.calibration
    page = Page(f"Calibration of {calibration.serial or 'a DIGIT'}")
    page.note(
        f"{calibration.touched}, of {len(result.presses)} images, {calibration.date}. Each is measured with a "
        "calibration that was made without it."
    )
    for warning in result.warnings:
        page.note(f"Warning: {warning}.")
    page.table(["median", "before", "after", "truth"], figure_rows(result))
    figure = penetration_figure(_rows(result, images, sensor), TITLES)
    page.picture(folder / _PICTURE, "Presses before and after")
    if calibration.presses > _MOST_SHOWN:
        page.note(f"The first {_MOST_SHOWN} of {calibration.presses} are shown.")
    unused = [[press.name, press.problem] for press in result.presses if press.problem]
    if unused:
        page.heading("Not used")
        page.table(["image", "why"], unused)
    with whole_folder(folder) as fresh:
        save(figure, fresh / _PICTURE)
        page.write(fresh / "index.html")
    return folder / "index.html"


def figure_rows(result: Result) -> list[list[str]]:
    """Return the rows that rate a calibration: name, before, after, truth."""
    figures, diameter = result.figures, result.calibration.ball_diameter
    lengths = {name: 1e3 * value for name, value in figures.items()}
    rows = [
        _row(figures, "steepness", "steepness of the slopes, of the true ones", 1.0),
        _row(figures, "explained", "fraction of the slopes explained", 1.0),
        _row(lengths, "felt_error", "error of the measured penetration, mm", 0.0),
    ]
    if diameter:
        rows.insert(0, _row(lengths, "felt_radius", "radius of the ball by the colours, mm", 500 * diameter))
        rows.insert(1, _row(lengths, "depth_radius", "radius of the ball by the penetration, mm", 500 * diameter))
    return rows


def _row(figures: dict[str, float], name: str, title: str, truth: float) -> list[str]:
    return [title, f"{figures[f'{name}_before']:.2f}", f"{figures[f'{name}_after']:.2f}", f"{truth:.2f}"]


def _rows(result: Result, images: dict[str, np.ndarray], sensor: SensorModel) -> list[PenetrationRow]:
    """Return each touch as measured before and after, and the true penetration."""
    tdn, rows = load_tdn("fast", sensor), []
    for press, calibration, penetration in zip(result.presses, result.held_out, result.penetrations, strict=True):
        if calibration is None:
            continue
        image = images[press.name]
        measured = (measured_with(tdn, each, image, result.background) for each in (None, calibration))
        rows.append(PenetrationRow(press.name, image, press.change, (*measured, np.maximum(penetration, 0))))
    return rows[:_MOST_SHOWN]
