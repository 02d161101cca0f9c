"""Tables of the effect of soft gel on maps, depth, poses and codes: of a result or the newest report."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from ..statistics.intervals import bootstrap_interval
from .reports import report
from .table import Form, Row, Table, between, is_missing, text

_GEL: dict[str, Form] = {
    "gel": lambda row: "as fitted" if is_missing(row["thickness_mm"]) else f"elastic, {row['thickness_mm']:g} mm",
    "calibrated": lambda row: "yes" if row["calibrated"] else "no",
}


def soft_gel(content: dict | None = None) -> pd.DataFrame:
    """Table of soft gel's effect on maps, poses and codes: medians, and the 90 % range of errors along the normal."""
    content = content or report("soft_gel")
    rows = []
    for kind, group in _of_gels(content["touches"]):
        normal = bootstrap_interval(group["normal_mm"], group["object"].tolist(), np.median)
        spread = {f"q{k}": group["normal_mm"].quantile(k / 100) for k in (5, 95)}
        one_touch = group["best_m"].sum() / group["random_m"].sum()
        middle = group.drop(columns=list(kind)).median(numeric_only=True)
        rows.append(kind | {"trials": len(group), "normal": normal, "one_touch": one_touch} | spread | dict(middle))

    def along_the_normal(row: Row) -> str:
        most = f"{row['q5']:+.2f} to {row['q95']:+.2f}"
        return f"{row['normal_mm']:+.2f} mm ({between(row['normal'], '{:+.2f}')}; 90 %: {most})"

    claims = {
        "deepest over the object's": text("deepest", "{:.2f}"),
        "area over the object's": text("area", "{:.2f}"),
        "pose off along the normal": along_the_normal,
        "across": text("tangential_mm", "{:.2f} mm"),
        "tilt": text("tilt_deg", "{:.1f} deg"),
        "one touch": text("one_touch", "{:.3f}"),
    }
    return Table(_GEL | {"touches": text("trials")}, claims).of(rows)


def commanded_depth(content: dict | None = None) -> pd.DataFrame:
    """Table of errors of the depth that is read from presses of a known depth on soft gel."""
    claims = {
        "depth less the commanded one, median": text("bias", "{:+.2f} mm"),
        "error, median": lambda row: f"{row['error']:.2f} mm ({between(row['interval'], '{:.2f}')})",
    }
    about = {"pressed in": text("press")} | _GEL | {"presses": text("trials")}
    return Table(about, claims).of(commanded_depths(content or report("soft_gel")))


def commanded_depths(content: dict) -> Iterator[dict]:
    """Yield a row for each kind of press and gel of a result: the pressed shape, the number of presses, median bias and
    error [mm] of the depth that is read."""
    for kind, group in _of_gels(content["presses"], "press"):
        off = group["depth_mm"] - group["commanded_mm"]
        interval = bootstrap_interval(off.abs(), range(len(off)), np.median)
        figures = {"bias": off.median(), "error": off.abs().median(), "interval": interval}
        yield kind | {"trials": len(off)} | figures


def _of_gels(rows: list[dict], *further: str) -> Iterator[tuple[dict, pd.DataFrame]]:
    """Yield (keys, rows) for each calibration, thickness and `further` key in rows of a result."""
    keys = [*further, "calibrated", "thickness_mm"]
    frame = pd.DataFrame(rows).sort_values(keys, na_position="first", kind="stable")
    for kind, group in frame.groupby(keys, dropna=False, sort=False):
        yield dict(zip(keys, kind, strict=True)), group
