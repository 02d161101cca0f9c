"""The page of a calibration: every press before and after, felt with a calibration that has not seen it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from midastouch_perception.ball_calibration.fit import Result, penetration_of
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn

from .figures import PENETRATION_COLOURS, save
from .page import Page

_TITLES = ("difference", "felt before", "felt after", "the ball")
_ACROSS = 2  # presses side by side


def calibration_page(result: Result, images: dict[str, np.ndarray], sensor: SensorModel, folder: Path) -> Path:
    """Write `index.html` and its picture into a folder; returns the page's path.

    images (320, 240, 3) uint8 RGB by name, of which `result` was made; sensor, full size.
    """
    folder.mkdir(parents=True, exist_ok=True)
    calibration, figures = result.calibration, result.figures
    page = Page(f"Calibration of {calibration.serial or 'a DIGIT'}")
    page.note(
        f"{calibration.presses} of {len(result.presses)} presses of a ball of {1e3 * calibration.ball_diameter:g} mm, "
        f"{calibration.date}. Each press is felt with a calibration that was made without it."
    )
    page.table(
        ["median over presses", "before", "after", "truth"],
        [
            [
                "radius of the ball by the colours, mm",
                f"{1e3 * figures['felt_radius_before']:.2f}",
                f"{1e3 * figures['felt_radius_after']:.2f}",
                f"{500 * calibration.ball_diameter:.2f}",
            ],
            [
                "slopes of the ball explained",
                f"{figures['explained_before']:.2f}",
                f"{figures['explained_after']:.2f}",
                "1.00",
            ],
        ],
    )
    page.picture(save(_figure(result, images, sensor), folder / "presses.png"), "Presses before and after")
    unused = [[press.name, press.problem] for press in result.presses if press.problem]
    if unused:
        page.heading("Not used")
        page.table(["image", "why"], unused)
    return page.write(folder / "index.html")


def _figure(result: Result, images: dict[str, np.ndarray], sensor: SensorModel) -> Figure:
    """Five pictures a press, two presses a row; one colour scale of penetration for all."""
    shown = [(p, c) for p, c in zip(result.presses, result.held_out, strict=True) if c is not None]
    plain = load_tdn("fast", sensor)
    rows = []
    for press, calibration in shown:
        image = images[press.name]
        before = plain.predict(image, result.background)
        after = load_tdn("fast", sensor, calibration=calibration).predict(image, result.background)
        ball = np.maximum(penetration_of(press, 0.5 * calibration.ball_diameter, result.sensor), 0)
        rows.append((press, image, (before, after, ball)))
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
