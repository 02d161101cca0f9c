"""Pictures of real presses of a ball."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_tools.datasets.ball_presses import load_ball_presses
from midastouch_tools.drawing.figures import PENETRATION_COLOURS

from ..perception.press_quality import MeasuredPress, as_measured
from ..perception.press_truth import calibrations_of, usable_presses, with_truth

_ACROSS = 2  # presses side by side
_TITLES = ("image", "difference", "measured", "ideal")


def press_figure(presses: list[MeasuredPress]) -> Figure:
    """Draw four pictures a press, two presses a row, with one colour scale of penetration for all."""
    rows = -(-len(presses) // _ACROSS)
    figure = Figure(figsize=(12, 2.1 * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, 4 * _ACROSS, squeeze=False)
    for one in axes.ravel():
        one.set_axis_off()
    deepest = max(1e-4, *(float(map_.max()) for p in presses for map_ in (p.measured, p.ideal) if map_ is not None))
    for k, press in enumerate(presses):
        four = axes[k // _ACROSS, 4 * (k % _ACROSS) :][:4]
        four[0].imshow(press.image)
        four[1].imshow(np.clip(128 + press.difference, 0, 255).astype(np.uint8))
        for cell, penetration in zip(four[2:], (press.measured, press.ideal), strict=True):
            if penetration is not None:
                shown = cell.imshow(1e3 * penetration, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * deepest)
        for cell, title in zip(four, (press.name, *_TITLES[1:]), strict=True):
            cell.set_title(title, fontsize=8, loc="left")
    bar = figure.colorbar(shown, ax=axes, location="right", fraction=0.012, pad=0.01)
    bar.set_label("penetration [mm]", fontsize=9)
    return figure


def depth_figure(content: dict) -> Figure:
    """Plot measured depth and measured radius over the pressed depth, of every press of an result,
    with the truth."""
    known = [row for row in content["presses"] if row["ideal_peak_mm"] is not None]
    figure = Figure(figsize=(10, 3), layout="constrained")
    depth, radius = figure.subplots(1, 2)
    pressed = [row["ideal_peak_mm"] for row in known]
    depth.plot(pressed, [row["felt_peak_mm"] for row in known], "o", ms=4, color="#1f77b4")
    depth.plot([0, max(pressed, default=1)], [0, max(pressed, default=1)], color="#2ca02c", lw=1)
    depth.set_ylabel("deepest measured [mm]", fontsize=9)
    round_ones = [row for row in known if row["felt_radius_mm"] is not None]
    measured = [row["felt_radius_mm"] for row in round_ones]
    radius.plot([row["ideal_peak_mm"] for row in round_ones], measured, "o", ms=4, color="#1f77b4")
    radius.axhline(500 * content["ball_diameter"], color="#2ca02c", lw=1)
    radius.set_ylabel("radius measured [mm]", fontsize=9)
    for axes in (depth, radius):
        axes.set_xlabel("pressed [mm]", fontsize=9)
        axes.set_ylim(0, None)
        axes.grid(color="#eceef1", lw=0.7)
    return figure


_SHOWN = 12


def shown_presses(content: dict) -> list[MeasuredPress]:
    """Measure `_SHOWN` presses again with the network of the result; InputError if it or the images are gone."""
    sensor = SensorModel.load(content["sensor"])
    if content["px_per_mm"]:
        sensor = sensor.at_scale(1e3 * content["px_per_mm"])
    tdn = load_tdn(content["tdn"], sensor)
    if tdn.network_id != content["network"]:
        raise InputError(f"the network is now {tdn.network_id}; measure them again")
    presses, _ = usable_presses(load_ball_presses(content["folder"]), sensor)
    names = list(presses.images)
    some = np.unique(np.linspace(0, len(names) - 1, _SHOWN).round().astype(int))
    calibrations = calibrations_of(content, presses, sensor)
    shown = with_truth(presses, content["ball_diameter"], sensor).presses.only([names[k] for k in some])
    return list(as_measured(tdn, shown, content["ball_diameter"] / 2, calibrations))
