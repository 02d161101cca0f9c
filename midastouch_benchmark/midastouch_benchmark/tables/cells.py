"""Figures in words, as they stand in a cell of a table."""

from __future__ import annotations

import math


def pose_cell(millimetres: float, degrees: float) -> str:
    return f"{millimetres:.1f} mm, {degrees:.1f} deg"


def final_error(summary: dict, prefix: str, statistic: str) -> str:
    """A final error over all trials of a summary: `e` of the particles, `closest_mode`, `estimate`."""
    millimetres, degrees = (summary[f"{prefix}_{unit}"].get(statistic) for unit in ("trans_mm", "rot_deg"))
    return "-" if millimetres is None else pose_cell(millimetres, degrees)


def part_of(part: int, whole: int) -> str:
    return f"{part} of {whole}"


def percent(share: float, digits: int = 0) -> str:
    return f"{100 * share:.{digits}f} %"


def share_cell(one: dict, digits: int = 0) -> str:
    if one["share"] is None:
        return "-"
    return f"{percent(one['share'], digits)} ({between(one['interval'], f'{{:.{digits}%}}')})"


def between(interval: list[float] | None, form: str) -> str:
    return "-" if interval is None else "...".join("never" if one is None else form.format(one) for one in interval)


def frames_cell(one: dict) -> str:
    """Frames with their interval; none in the report: infinitely many."""
    value = "never" if one["value"] is None else f"{one['value']:.0f}"
    return f"{value} ({between(one['interval'], '{:.0f}')})"


def millimetres(path: float) -> str:
    return "never" if math.isinf(path) else f"{1e3 * path:.0f}"


def millimetres_between(interval: list[float] | None) -> str:
    return "-" if interval is None else "...".join(map(millimetres, interval))
