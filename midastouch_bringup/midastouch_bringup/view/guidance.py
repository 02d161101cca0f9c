"""How the guide through a calibration looks in the live view."""

from __future__ import annotations

from collections.abc import Mapping

from midastouch_perception.sensor_calibration.collector import REGIONS

from ..datasets.sequence import IMAGE_SHAPE

_TO_DO, _DONE = "\u25cb", "\u25cf"


def guidance_text(step: str, values: Mapping[str, str]) -> str:
    """What to do next, progress, and the presses thrown away with the reasons, as Markdown.

    values: those of the node `calibrate` on `/diagnostics`.
    """
    taken, wanted = int(values.get("taken", 0)), int(values.get("wanted", 0))
    lines = [f"# {step}", _DONE * taken + _TO_DO * max(wanted - taken, 0)]
    if values.get("last_press"):
        lines.append(f"Last press: {values['last_press']}")
    reasons = [reason for name, reason in values.items() if name.startswith("thrown_away_")]
    if reasons:
        lines.append(f"Thrown away: {values['thrown_away']}, the last ones:")
        lines.append("\n".join(f"- {reason}" for reason in reasons))
    return "\n\n".join(lines)


def region_box(region: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Corner with the lowest coordinates and size [px], x first, of one of `REGIONS` in the image."""
    row, column = divmod(REGIONS.index(region), 3)
    width, height = IMAGE_SHAPE[1] / 3, IMAGE_SHAPE[0] / 3
    return (column * width, row * height), (width, height)
