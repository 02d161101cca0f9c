"""Tables of identification and exploration: which object is touched, and where to touch next."""

from __future__ import annotations

import pandas as pd

from ..statistics.exploring import summarise_exploration
from .reports import frame_of, report, reported
from .table import Form, Row, fraction, is_missing, text, tidy, value, written


def _slides(row: Row) -> str:
    return "-" if is_missing(row.get("known")) else f"{row['known']:.0f} with, {row['unknown']:.0f} without"


IDENTIFICATION: dict[str, Form] = {
    "right at the end": fraction("right"),
    "pose right, too": fraction("pose_right"),
    "pose, object known": fraction("alone_pose_right"),
    "refused, when left out": fraction("refused"),
    "path until right, median": value("path_until_right", "{:.2f}", " m", never=True),
    "expected calibration error": text("calibration_error", "{:.3f}"),
    "CPU a frame, over one known object's": value("cpu_ratio", "{:.2f}"),
}


_PATH = value("path_m", "{:.0f}", " mm", never=True, scale=1e3)
EXPLORATION: dict[str, Form] = {
    "converged right": fraction("right"),
    "converged wrong": fraction("wrong"),
    "said alike": fraction("alike"),
    "path until right, median": _PATH,
    "over that of random": text("path_ratio", "{:.2f}"),
    "answers within, CPU": text("asked_ms", "{:.0f} ms"),
    "simulated time until right, median": value("seconds", "{:.0f}", " s"),
    "deepest in the gel": text("deepest_mm", "{:.2f} mm"),
}


def identification_table(frame: pd.DataFrame, sources: str | None = None) -> pd.DataFrame:
    """Table of how well objects of a catalogue are identified; frame: of summaries, its `what` names the catalogue."""
    return written(frame, {"catalogue": text("what"), "slides": _slides}, IDENTIFICATION, sources)


def identification_row(what: str, summary: dict) -> dict:
    """Return the row of a summary in the frame of `identification_table`."""
    trials = summary["known"] if summary["enough"] else min(summary["known"], summary["unknown"])
    return {"what": what, "trials": trials} | {key: one for key, one in summary.items() if key != "answers"}


def exploration_rows(trials: list[dict], policies: dict[str, str]) -> list[dict]:
    """Return rows on the path of a finger until its pose is known, by policy and object, and over all objects."""
    rows = []
    for name, one in summarise_exploration(trials).items():
        for what, each in [*one["objects"].items(), ("all", {key: one[key] for key in one if key != "objects"})]:
            rows.append({"what": policies[name], "object": what} | each)
    return rows


def exploration_table(trials: list[dict], policies: dict[str, str]) -> pd.DataFrame:
    """Table of `exploration_rows`."""
    about = {"finger goes": text("what"), "object": text("object"), "trials": text("trials")}
    return written(tidy(exploration_rows(trials, policies)), about | EXPLORATION, {})


def identification() -> pd.DataFrame:
    """Table of how well objects of a catalogue are identified, from the newest reports."""
    names = {"identify": "the ten", "identify_cad": "CAD parts", "identify_all": "all 78 of YCB"}
    frame = frame_of(names, lambda name: identification_row(names[name], report(name)["identification"]))
    return identification_table(frame, "report")


def exploration() -> pd.DataFrame:
    """Table of fingers that follow suggestions where to touch next, and of one that touches at random."""
    if "exploration" not in reported():
        return written(frame_of({"exploration": "-"}, report), {"finger goes": text("what")}, EXPLORATION, "report")
    rows = []
    for name in ("exploration", "exploration_arm"):
        if name in reported():
            content = report(name)
            part = exploration_rows(content["trials"], content["config"]["policies"])
            rows += [row | {"report": name} for row in part if row["object"] == "all"]
    return written(tidy(rows), {"finger goes": text("what"), "trials": text("trials")}, EXPLORATION, "report")
