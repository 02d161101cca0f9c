"""The page of a calibration: every press before and after, felt with a calibration that has not seen it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from midastouch_perception.ball_calibration.fit import Result
from midastouch_perception.sensor_calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet, load_tdn

from .figures import PENETRATION_COLOURS, save
from .page import Page

_TITLES = ("difference", "felt before", "felt after", "pressed")
_MOST_SHOWN = 20
_ACROSS = 2  # presses side by side


def calibration_page(result: Result, images: dict[str, np.ndarray], sensor: SensorModel, folder: Path) -> Path:
    """Write `index.html` and its picture into a folder; returns the page's path.

    images (320, 240, 3) uint8 RGB by name, of which `result` was made; sensor, full size.
    """
    folder.mkdir(parents=True, exist_ok=True)
    calibration = result.calibration
    page = Page(f"Calibration of {calibration.serial or 'a DIGIT'}")
    page.note(
        f"{calibration.touched}, of {len(result.presses)} images, {calibration.date}. Each is felt with a calibration "
        "that was made without it."
    )
    if result.doubt:
        page.note(f"Warning: {result.doubt}.")
    page.table(["median", "before", "after", "truth"], figure_rows(result))
    page.picture(save(_figure(result, images, sensor), folder / "presses.png"), "Presses before and after")
    unused = [[press.name, press.problem] for press in result.presses if press.problem]
    if unused:
        page.heading("Not used")
        page.table(["image", "why"], unused)
    return page.write(folder / "index.html")


def figure_rows(result: Result) -> list[list[str]]:
    """What the calibration is worth: name, before, after, truth."""
    figures, diameter = result.figures, result.calibration.ball_diameter
    rows = [
        _row(figures, "steepness", "steepness of the slopes, of the true ones", 1.0),
        _row(figures, "explained", "share of the slopes explained", 1.0),
    ]
    if diameter:
        radius = {name: 1e3 * value for name, value in figures.items()}
        rows.insert(0, _row(radius, "felt_radius", "radius of the ball by the colours, mm", 500 * diameter))
    return rows


def _row(figures: dict[str, float], name: str, title: str, truth: float) -> list[str]:
    return [title, f"{figures[f'{name}_before']:.2f}", f"{figures[f'{name}_after']:.2f}", f"{truth:.2f}"]


def _felt(
    tdn: DepthNet, image: np.ndarray, background: np.ndarray, calibration: SensorCalibration | None
) -> np.ndarray:
    tdn.calibration = calibration
    return tdn.predict(image, background)


def _figure(result: Result, images: dict[str, np.ndarray], sensor: SensorModel) -> Figure:
    """Five pictures a press, two presses a row; one colour scale of penetration for all."""
    every = zip(result.presses, result.held_out, result.penetrations, strict=True)
    shown = [each for each in every if each[1] is not None][:_MOST_SHOWN]
    tdn = load_tdn("fast", sensor)
    rows = []
    for press, calibration, penetration in shown:
        image = images[press.name]
        before, after = (_felt(tdn, image, result.background, each) for each in (None, calibration))
        rows.append((press, image, (before, after, np.maximum(penetration, 0))))
    deepest = max(1e-4, *(float(relief.max()) for _, _, reliefs in rows for relief in reliefs))
    lines = -(-len(rows) // _ACROSS)
    figure = Figure(figsize=(14, 2.1 * lines + 0.4), layout="constrained")
    axes = figure.subplots(lines, 5 * _ACROSS, squeeze=False)
    for one in axes.ravel():
        one.set_axis_off()
    for k, (press, image, reliefs) in enumerate(rows):
        cells = axes[k // _ACROSS, 5 * (k % _ACROSS) :][:5]
        cells[0].imshow(image)
        cells[1].imshow(np.clip(128 + press.change, 0, 255).astype(np.uint8))
        for cell, relief in zip(cells[2:], reliefs, strict=True):
            mapped = cell.imshow(1e3 * relief, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * deepest)
        for cell, title in zip(cells, (press.name, *_TITLES), strict=True):
            cell.set_title(title, fontsize=8, loc="left")
    bar = figure.colorbar(mapped, ax=axes, location="right", fraction=0.012, pad=0.01)
    bar.set_label("penetration [mm]", fontsize=9)
    return figure
