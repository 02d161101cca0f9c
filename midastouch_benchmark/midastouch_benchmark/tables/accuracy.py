"""Tables of the filter's final errors: over conditions, starts, contacts and objects, and against the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import pandas as pd

from ..statistics.accuracy import final_errors, is_right, right_or_among_modes_at_end
from ..statistics.intervals import Figures
from .reports import CONDITIONS, STARTS, benchmark_summary, frame_of, further, report, reported
from .table import UNMEASURED, Form, Row, fraction, is_missing, listed, part, percent, pose, text, tidy, value, written

ENDS: dict[str, Form] = {
    "particles, mean": pose("e", "mean", "trust.e_trans_mm.mean.interval"),
    "closest mode, median": pose("closest_mode", "median", "trust.closest_mode_trans_mm.median.interval"),
    "right": fraction("trust.right_at_end"),
}
"""Columns on the end of a slide, of a benchmark's summary."""


def _found_again(row: Row) -> str:
    before = row.get("trust.right_before_event.share")
    return "-" if is_missing(before) else f"{fraction('trust.found_again')(row)} of {100 * before:.0f} %"


def _until_right(row: Row) -> str:
    event = not is_missing(row.get("trust.right_after_event.share"))
    return value("trust.frames_until_right.median", "{:.0f}", never=True)(row) if event else "-"


LOCALISATION: dict[str, Form] = ENDS | {
    "right, or `ambiguous` with the truth among the modes": fraction("among"),
    "found 30 frames after the event, of those right before": _found_again,
    "frames until right again, median": _until_right,
    "frames converged wrong": fraction("trust.converged_wrong", 1),
    "truth in the 95 % region, converged": fraction("trust.region_95"),
}
OBJECTS: dict[str, Form] = {
    "particles, mean": pose("e", "mean"),
    "closest mode, median": pose("closest_mode", "median"),
    "right": part("right"),
    "rate": text("hz_mean", "{:.0f} Hz"),
}
"""Columns on the trials over one object, without intervals."""
_MORE = {
    "pose, median": pose("estimate", "median"),
    "converged": part("converged"),
    "converged wrong, of frames": percent("wrong_converged", 1),
    "said to be another object": percent("foreign"),
}
PAPER = {"particles, mean": "7.4 mm, 9.4 deg", "closest mode, median": "2.8 mm, 2.0 deg"}
"""The paper's final errors over its ten objects in simulation."""


def summary_row(summary: dict, trials: list[dict]) -> dict:
    """Return a benchmark's summary as a row of a tidy frame; trials: those that it summarises."""
    return {key: each for key, each in summary.items() if key != "objects"} | {
        "among": right_or_among_modes_at_end(trials)
    }


def localisation() -> pd.DataFrame:
    """Table of final errors on ten objects, undisturbed and disturbed, ten further ones, and CAD parts."""
    names = {name: what for name, what in (STARTS | CONDITIONS | further()).items() if name in reported()}
    frame = frame_of(names, lambda name: summary_row(benchmark_summary(name), report(name)["trials"]))
    table = written(frame, {"conditions": text("what")}, LOCALISATION, "report")
    paper_row = {"conditions": "*paper, start as above*"} | PAPER
    return pd.concat([table, pd.DataFrame([paper_row])], ignore_index=True).fillna("-")


def areas() -> pd.DataFrame:
    """Table of slides with a smaller or larger contact than usual on their object; the paper's figure 23."""
    trials = [trial for name in STARTS for trial in report(name)["trials"]]
    area = pd.Series([t["contact_area_mm2"] for t in trials], dtype=float)
    smaller = area < area.groupby([t["object"] for t in trials]).transform("median")
    rows = []
    for what, chosen in (("smaller than usual on its object", smaller), ("at least that", ~smaller)):
        some = [trial for trial, is_chosen in zip(trials, chosen, strict=True) if is_chosen]
        figures = Figures.by_slide(some)
        rows.append({
            "what": what, "trials": len(some), "area": area[chosen].mean(), "report": "] [".join(STARTS),
            "error": figures.value(final_errors(some, "e_trans_mm"), np.mean),
            "right": figures.fraction([is_right(trial) for trial in some]),
        })  # fmt: skip
    claims = {
        "its mean": text("area", "{:.0f} mm2"),
        "particles, mean": value("error", "{:.1f}", " mm"),
        "right": fraction("right"),
    }
    return written(tidy(rows), {"contact of the slide": text("what"), "trials": text("trials")}, claims, "reports")


def slides() -> pd.DataFrame:
    """Table of the slides of another renderer, which development used."""
    rows = [
        {"what": name, "start": start, "report": source} | one
        for source, start in (("evaluate_paper", "as the paper's"), ("evaluate_uniform", "nothing known"))
        for name, one in report(source)["summary"]["objects"].items()
    ]
    return written(tidy(rows), {"object": text("what"), "start": text("start")} | OBJECTS, {}, "report")


def objects(
    summary: dict, symmetries: Mapping[str, str] | None = None, beside: Mapping[str, object] | None = None
) -> pd.DataFrame:
    """Table of one summary of `evaluate` or `benchmark`: a row for each object, and one for all of them.

    symmetries: a description by object, if known; beside: cells of a last row by label, such as the paper's.
    """
    about: dict[str, Form] = {"object": text("what"), "trials": text("trials")}
    more = {label: _MORE[label] for label in ("pose, median", "converged")}
    if symmetries is not None:
        about["symmetry"] = lambda row: symmetries.get(row["what"], "")
        more = _MORE
    every = {key: one for key, one in summary.items() if key != "objects"}
    rows = [*summary["objects"].items(), *([("all", every)] if len(summary["objects"]) > 1 else [])]
    frame = tidy({"what": name} | one for name, one in rows)
    table = written(frame, about | OBJECTS | more, {})
    return table if beside is None else pd.concat([table, pd.DataFrame([beside])], ignore_index=True).fillna("-")


def real_row(content: dict) -> dict | None:
    """Return the paper's row for an `evaluate` result over its real slides; None for other results."""
    if not (theirs := content.get("paper_real")):
        return None
    words = {"object": "the paper, real slides", "trials": theirs["trials"]}
    for label, prefix in (("particles, mean", "e"), ("closest mode, median", "min_cluster")):
        words[label] = f"{theirs[f'{prefix}_trans_mm']:.1f} mm, {theirs[f'{prefix}_rot_deg']:.1f} deg"
    return words


def paper() -> pd.DataFrame:
    """Table of the README: figures of this filter and of the paper."""
    there = reported()

    @cache
    def summary(name: str) -> Row:
        return tidy([benchmark_summary(name)]).iloc[0].to_dict()

    def bench(form: str, *keys: str) -> str:
        row = tidy([report("bench")]).iloc[0].to_dict()
        return "; ".join(str(text(key, form)(row)) for key in keys)

    rows: list[tuple[str, str, Callable[[], str], str]] = [
        ("final error of the particles, mean over ten objects, start as the paper's", "accuracy",
         lambda: pose("e", "mean")(summary("accuracy")), PAPER["particles, mean"]),
        ("final error of the closest mode, median over the same", "accuracy",
         lambda: pose("closest_mode", "median")(summary("accuracy")), PAPER["closest mode, median"]),
        ("converged and right at the end", "accuracy", lambda: part("right")(summary("accuracy")), "-"),
        ("the same, with nothing known at the start", "accuracy_uniform",
         lambda: part("right")(summary("accuracy_uniform")), "-"),
        ("depth network, RMSE on slides of another renderer", "evaluate_tdn",
         lambda: f"{report('evaluate_tdn')['summary']['rmse_mm']:.3f} mm", "0.135 mm"),
        ("single touch: error of the 25 best matches, relative to random ones", "single_touch",
         lambda: f"{report('single_touch')['summary']['normalised_top25_error']:.3f}", "0.473"),
        ("images to estimates on two CPU cores: not converged yet; converged", "bench",
         lambda: bench("{:.0f} Hz", "end_to_end_hz", "converged_hz"), "10 Hz on a GPU"),
        ("filter step until its answer: not converged yet; converged", "bench",
         lambda: bench("{:.1f} ms", "filter_ms.searching.p50", "filter_ms.converged.p50"), "-"),
    ]  # fmt: skip
    return listed(
        ("what", "this", "paper", "report"),
        [(what, cell() if name in there else UNMEASURED, theirs, f"[{name}]") for what, name, cell, theirs in rows],
    )
