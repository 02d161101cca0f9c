"""The section of the results page on real presses of a ball."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from midastouch_perception.errors import InputError
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn

from ..evaluation.press_quality import ball_renderer, load_presses, render_ball
from ..evaluation.table import number
from .figures import save
from .page import Page
from .press_figure import PressPicture, press_figure, radius_figure

_SHOWN = 12
_HEADER = ["network", "presses", "found", "bulging", "radius mm", "spread", "residual mm", "curvature ratio"]
_HEADER += ["roundness", "felt outside", "explained", "RMSE to ball mm", "IoU with ball"]


def press_section(page: Page, contents: list[dict], folder: Path) -> None:
    """Table, scatter of the fits, and pictures of `_SHOWN` presses of each `evaluate-presses` result."""
    page.heading("Real presses of a ball")
    page.note(
        "Nobody knows the true penetration. The relief of a ball has one radius in all presses and directions "
        "(curvature ratio 1), bulges towards the camera, and is felt nowhere outside contact and shadow."
    )
    page.table(_HEADER, [_row(content) for content in contents])
    for i, content in enumerate(contents):
        page.picture(save(radius_figure(content["presses"]), folder / f"press_fits_{i}.png"), "Fits over the presses")
        try:
            pictures = _pictures(content)
        except InputError as error:
            page.note(f"no pictures of the presses: {error}")
            continue
        page.picture(save(press_figure(pictures), folder / f"presses_{i}.png"), f"Presses of {content['folder']}")


def _row(content: dict) -> list[object]:
    s = content["summary"]
    return [
        content["network"],
        s["presses"],
        number(s["found_share"], 2),
        number(s["bulges_share"], 2),
        number(s["radius_mm"], 2),
        number(s["radius_spread"], 2),
        number(s["residual_mm"], 3),
        *(number(s[k], 2) for k in ("curvature_ratio", "roundness", "outside_share", "explained_share")),
        number(s["ball_rmse_mm"], 3),
        number(s["ball_iou"], 2),
    ]


def _pictures(content: dict) -> list[PressPicture]:
    """Felt once more with the network of the result; InputError if that or the images are not there any more."""
    tdn = load_tdn(content["tdn"], SensorModel.load(content["sensor"]))
    if tdn.network_id != content["network"]:
        raise InputError(f"the network is now {tdn.network_id}; run midastouch evaluate-presses again")
    images, background = load_presses(content["folder"])
    rows = [row for row in content["presses"] if row["image"] in images]
    radius = content["summary"]["radius_mm"]
    renderer = ball_renderer(1e-3 * radius, tdn.sensor) if radius else None
    pictures = []
    for k in np.unique(np.linspace(0, len(rows) - 1, _SHOWN).round().astype(int)):
        row, image = rows[k], images[rows[k]["image"]]
        centre = row.get("ball_centre_mm")
        fitted = render_ball(renderer, 1e-3 * np.array(centre)) if renderer and centre else None
        difference = tdn.difference(image, background)
        felt = tdn.predict(image, background, difference)
        pictures.append(PressPicture(row["image"], image, difference, felt, fitted))
    return pictures
