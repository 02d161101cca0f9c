"""Tables of the filter's final errors: over conditions, starts, contacts and objects, and against the paper."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ..statistics.accuracy import final_errors, is_right, right_or_among_modes_at_end
from ..statistics.intervals import Figures
from .reports import CONDITIONS, STARTS, benchmark_summary, further, report, reported, rows_of
from .table import (
    UNMEASURED,
    Form,
    Row,
    Table,
    flat,
    fraction,
    is_missing,
    listed,
    part,
    percent,
    pose,
    several,
    text,
    value,
    with_row,
)


def _found_again(row: Row) -> str:
    before = row.get("trust.right_before_event.share")
    return "-" if is_missing(before) else f"{fraction('trust.found_again')(row)} of {100 * before:.0f} %"


def _until_right(row: Row) -> str:
    event = not is_missing(row.get("trust.right_after_event.share"))
    return value("trust.frames_until_right.median", "{:.0f}", never=True)(row) if event else "-"


LOCALISATION = Table(
    {"conditions": text("what")},
    {
        "particles, mean": pose("e", "mean", "trust.e_trans_mm.mean.interval"),
        "closest mode, median": pose("closest_mode", "median", "trust.closest_mode_trans_mm.median.interval"),
        "right": fraction("trust.right_at_end"),
        "right, or `ambiguous` with the truth among the modes": fraction("among"),
        "found 30 frames after the event, of those right before": _found_again,
        "frames until right again, median": _until_right,
        "frames converged wrong": fraction("trust.converged_wrong", 1),
        "truth in the 95 % region, converged": fraction("trust.region_95"),
    },
)
"""Columns on a summary of a benchmark, a row of `summary_row`."""
_OBJECTS: dict[str, Form] = {
    "particles, mean": pose("e", "mean"),
    "closest mode, median": pose("closest_mode", "median"),
    "right": part("right"),
    "rate": text("hz_mean", "{:.0f} Hz"),
}
"""Columns on the trials over one object, without intervals."""


def _states(row: Row) -> str:
    counts = {key.removeprefix("states."): count for key, count in row.items() if key.startswith("states.")}
    return ", ".join(f"{state} {counts[state]:.0f}" for state in sorted(counts, key=counts.get, reverse=True))


_ESTIMATES: dict[str, Form] = {"pose, median": pose("estimate", "median"), "states at the end": _states}
_ALARMS: dict[str, Form] = {
    "converged wrong, of frames": percent("wrong_converged", 1),
    "said to be another object": percent("foreign"),
}
PAPER = {"particles, mean": "7.4 mm, 9.4 deg", "closest mode, median": "2.8 mm, 2.0 deg"}
"""The paper's final errors over its ten objects in simulation."""


def summary_row(summary: dict, trials: list[dict]) -> dict:
    """Return a benchmark's summary as a row; trials: those that it summarises."""
    whole = {key: each for key, each in summary.items() if key != "objects"}
    return whole | {"among": right_or_among_modes_at_end(trials)}


def localisation() -> pd.DataFrame:
    """Table of final errors on ten objects, undisturbed and disturbed, ten further ones, and CAD parts."""
    names = {name: what for name, what in (STARTS | CONDITIONS | further()).items() if name in reported()}
    rows = rows_of(names, lambda name: summary_row(benchmark_summary(name), report(name)["trials"]))
    return with_row(LOCALISATION.of(rows, "report"), {"conditions": "*paper, start as above*"} | PAPER)


def areas() -> pd.DataFrame:
    """Table of slides with a smaller or larger contact than usual on their object; the paper's figure 23."""
    trials = [trial for name in STARTS for trial in report(name)["trials"]]
    area = pd.Series([t["contact_area_mm2"] for t in trials], dtype=float)
    smaller = area < area.groupby([t["object"] for t in trials]).transform("median")
    rows = []
    for what, chosen in (("smaller than usual on its object", smaller), ("at least that", ~smaller)):
        some = [trial for trial, is_chosen in zip(trials, chosen, strict=True) if is_chosen]
        figures = Figures.by_slide(some)
        error = figures.value(final_errors(some, "e_trans_mm"), np.mean)
        figures_of = {"area": area[chosen].mean(), "error": error, "right": figures.fraction(list(map(is_right, some)))}
        rows.append({"what": what, "trials": len(some), "report": "] [".join(STARTS)} | figures_of)
    claims = {
        "its mean": text("area", "{:.0f} mm2"),
        "particles, mean": value("error", "{:.1f}", " mm"),
        "right": fraction("right"),
    }
    return Table({"contact of the slide": text("what"), "trials": text("trials")}, claims).of(rows, "reports")


def slides() -> pd.DataFrame:
    """Table of the slides of another renderer, which development used."""
    rows = [
        {"what": name, "start": start, "report": source} | one
        for source, start in (("evaluate_paper", "as the paper's"), ("evaluate_uniform", "nothing known"))
        for name, one in report(source)["summary"]["objects"].items()
    ]
    return Table({"object": text("what"), "start": text("start")} | _OBJECTS).of(rows, "report")


def objects(
    summary: dict, symmetries: Mapping[str, str] | None = None, beside: Mapping[str, object] | None = None
) -> pd.DataFrame:
    """Table of one summary of `evaluate` or `benchmark`: a row for each object, and one for all of them.

    symmetries: a description by object, if known; beside: cells of a last row by label, such as the paper's.
    """
    about: dict[str, Form] = {"object": text("what"), "trials": text("trials")}
    if symmetries is not None:
        about["symmetry"] = lambda row: symmetries.get(row["what"], "")
    every = {key: one for key, one in summary.items() if key != "objects"}
    rows = [*summary["objects"].items(), *([("all", every)] if len(summary["objects"]) > 1 else [])]
    columns = about | _OBJECTS | _ESTIMATES | ({} if symmetries is None else _ALARMS)
    return with_row(Table(columns).of({"what": name} | one for name, one in rows), beside)


def real_row(content: dict) -> dict | None:
    """Return the paper's row for an `evaluate` result over its real slides; None for other results."""
    if not (theirs := content.get("paper_real")):
        return None
    words = {"object": "the paper, real slides", "trials": theirs["trials"]}
    for label, prefix in (("particles, mean", "e"), ("closest mode, median", "min_cluster")):
        words[label] = f"{theirs[f'{prefix}_trans_mm']:.1f} mm, {theirs[f'{prefix}_rot_deg']:.1f} deg"
    return words


_AGAINST_THE_PAPER: tuple[tuple[str, str, Form, str], ...] = (
    ("final error of the particles, mean over ten objects, start as the paper's", "accuracy", pose("e", "mean"),
     PAPER["particles, mean"]),
    ("final error of the closest mode, median over the same", "accuracy", pose("closest_mode", "median"),
     PAPER["closest mode, median"]),
    ("converged and right at the end", "accuracy", part("right"), "-"),
    ("the same, with nothing known at the start", "accuracy_uniform", part("right"), "-"),
    ("depth network, RMSE on slides of another renderer", "evaluate_tdn", text("summary.rmse_mm", "{:.3f} mm"),
     "0.135 mm"),
    ("single touch: error of the 25 best matches, relative to random ones", "single_touch",
     text("summary.normalised_top25_error", "{:.3f}"), "0.473"),
    ("images to estimates on two CPU cores: not converged yet; converged", "bench",
     several("{:.0f} Hz", "", "end_to_end_hz", "converged_hz"), "10 Hz on a GPU"),
    ("filter step until its answer: not converged yet; converged", "bench",
     several("{:.1f} ms", "", "filter_ms.searching.p50", "filter_ms.converged.p50"), "-"),
)  # fmt: skip
"""Label, report, form and the paper's figure of each row of `paper`."""


def paper() -> pd.DataFrame:
    """Table of the README: figures of this filter and of the paper."""

    def cell(name: str, form: Form) -> object:
        if name not in reported():
            return UNMEASURED
        content = report(name)
        return form(flat(benchmark_summary(name) if "comparison" in content else content))

    rows = [(what, cell(name, form), theirs, f"[{name}]") for what, name, form, theirs in _AGAINST_THE_PAPER]
    return listed(("what", "this", "paper", "report"), rows)
