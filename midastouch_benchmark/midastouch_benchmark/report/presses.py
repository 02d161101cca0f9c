"""Pictures of real presses of a ball."""

from __future__ import annotations

from collections.abc import Iterator

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
_SHOWN = 12
_TITLES = ("image", "difference", "measured", "ideal")


def pictures(content: dict) -> Iterator[tuple[str, str, Figure] | str]:
    """Yield name, caption and figure of some presses of a result; a text says why they are missing."""
    try:
        yield "", f"Presses of {content['folder']}", press_figure(_shown(content))
    except InputError as error:
        yield f"no pictures of the presses: {error}"


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


def _shown(content: dict) -> list[MeasuredPress]:
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
