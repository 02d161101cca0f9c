"""The page of a calibration: every press before and after, felt with a calibration that has not seen it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from midastouch_perception.sensor_calibration.fit import Result
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn

from .figures import save
from .page import Page
from .penetration_rows import ReliefRow, felt_with, relief_figure

TITLES = "felt before", "felt after", "pressed"
"""What is shown of a touch beside its image."""
_MOST_SHOWN = 20


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
    for warning in result.warnings:
        page.note(f"Warning: {warning}.")
    page.table(["median", "before", "after", "truth"], figure_rows(result))
    figure = relief_figure(_rows(result, images, sensor), TITLES)
    page.picture(save(figure, folder / "presses.png"), "Presses before and after")
    if calibration.presses > _MOST_SHOWN:
        page.note(f"The first {_MOST_SHOWN} of {calibration.presses} are shown.")
    unused = [[press.name, press.problem] for press in result.presses if press.problem]
    if unused:
        page.heading("Not used")
        page.table(["image", "why"], unused)
    return page.write(folder / "index.html")


def figure_rows(result: Result) -> list[list[str]]:
    """What the calibration is worth: name, before, after, truth."""
    figures, diameter = result.figures, result.calibration.ball_diameter
    lengths = {name: 1e3 * value for name, value in figures.items()}
    rows = [
        _row(figures, "steepness", "steepness of the slopes, of the true ones", 1.0),
        _row(figures, "explained", "share of the slopes explained", 1.0),
        _row(lengths, "felt_error", "error of the felt depth, mm", 0.0),
    ]
    if diameter:
        rows.insert(0, _row(lengths, "felt_radius", "radius of the ball by the colours, mm", 500 * diameter))
    return rows


def _row(figures: dict[str, float], name: str, title: str, truth: float) -> list[str]:
    return [title, f"{figures[f'{name}_before']:.2f}", f"{figures[f'{name}_after']:.2f}", f"{truth:.2f}"]


def _rows(result: Result, images: dict[str, np.ndarray], sensor: SensorModel) -> list[ReliefRow]:
    """Each touch before and after, and what pressed."""
    tdn, rows = load_tdn("fast", sensor), []
    for press, calibration, penetration in zip(result.presses, result.held_out, result.penetrations, strict=True):
        if calibration is None:
            continue
        image = images[press.name]
        felt = (felt_with(tdn, each, image, result.background) for each in (None, calibration))
        rows.append(ReliefRow(press.name, image, press.change, (*felt, np.maximum(penetration, 0))))
    return rows[:_MOST_SHOWN]
