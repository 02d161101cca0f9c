"""The section of the results page on real presses of a ball."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from midastouch_bringup.datasets.ball_presses import load_ball_presses
from midastouch_bringup.drawing.figures import save
from midastouch_bringup.drawing.page import Page
from midastouch_bringup.text_table import number
from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn

from ..perception.held_out_calibrations import calibrations_of
from ..perception.press_quality import Press, feel_presses
from ..perception.press_truth import with_truth
from ..perception.usable_presses import usable_presses
from .press_figure import depth_figure, press_figure

_SHOWN = 12
_HEADER = [
    "folder",
    "network",
    "calibration",
    "ball mm",
    "truth",
    "presses",
    "found",
    "bulging",
    "RMSE in circle mm",
    "peak ratio",
]
_HEADER += ["depth correlation", "radius felt mm", "IoU nearest", "IoU ideal", "centre mm", "roundness", "felt outside"]


def press_section(page: Page, contents: list[dict], folder: Path) -> None:
    """Table, felt over pressed depth, and pictures of `_SHOWN` presses of each `evaluate-presses` result."""
    page.heading("Real presses of a ball")
    page.note(
        "The ideal contact is the cap of a ball of the true size under the contact's outline: the labelled circle, or "
        "where nobody labelled the one that the images tell. Where they tell none it is the felt outline, which "
        "flatters the network: do not judge depth by it. A good network has peak ratio and correlation near 1, and "
        "feels the true radius."
    )
    page.table(_HEADER, [_row(content) for content in contents])
    for i, content in enumerate(contents):
        page.picture(save(depth_figure(content), folder / f"press_depths_{i}.png"), "Felt over the presses")
        try:
            shown = _felt_again(content)
        except InputError as error:
            page.note(f"no pictures of the presses: {error}")
            continue
        page.picture(save(press_figure(shown), folder / f"presses_{i}.png"), f"Presses of {content['folder']}")


def _row(content: dict) -> list[object]:
    s = content["summary"]
    return [
        Path(content["folder"]).name,
        content["network"],
        _calibration(content),
        number(1e3 * content["ball_diameter"], 1),
        s.get("truth", "labels" if s["labelled"] else "felt outline"),
        s["presses"],
        number(s["found_share"], 2),
        number(s["bulges_share"], 2),
        number(s["rmse_in_circle_mm"], 2),
        number(s["peak_ratio"], 2),
        number(s["depth_correlation"], 2),
        number(s["felt_radius_mm"], 1),
        *(number(s[k], 2) for k in ("iou", "iou_ideal", "centre_mm", "roundness", "outside_share")),
    ]


def _calibration(content: dict) -> str:
    if content.get("calibration"):
        return Path(content["calibration"]).name
    return f"from {content['calibrated_with']} other presses" if content.get("calibrated_with") else "none"


def _felt_again(content: dict) -> list[Press]:
    """Some presses with the network of the result; InputError if that or the images are not there any more."""
    sensor = SensorModel.load(content["sensor"])
    if content["px_per_mm"]:
        sensor = sensor.at_scale(1e3 * content["px_per_mm"])
    tdn = load_tdn(content["tdn"], sensor)
    if tdn.network_id != content["network"]:
        raise InputError(f"the network is now {tdn.network_id}; run midastouch evaluate-presses again")
    presses, _ = usable_presses(load_ball_presses(content["folder"]), sensor)
    names = list(presses.images)
    some = np.unique(np.linspace(0, len(names) - 1, _SHOWN).round().astype(int))
    calibrations = calibrations_of(content, presses, sensor)
    shown = with_truth(presses, content["ball_diameter"], sensor).presses.only([names[k] for k in some])
    return list(feel_presses(tdn, shown, content["ball_diameter"] / 2, calibrations))
