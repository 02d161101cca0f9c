"""Tables of which object is touched, where to touch next, the filter against the ideal observer, and arm motions."""

from __future__ import annotations

import math

import pandas as pd

from ..statistics.exploring import summarise_exploration, too_deep
from ..statistics.intervals import Figures
from .reports import CONDITIONS, STARTS, report, reported, rows_of
from .table import Form, Row, Table, fraction, is_missing, text, value


def _slides(row: Row) -> str:
    return "-" if is_missing(row.get("known")) else f"{row['known']:.0f} with, {row['unknown']:.0f} without"


IDENTIFICATION = Table(
    {"catalogue": text("what"), "slides": _slides},
    {
        "right at the end": fraction("right"),
        "pose right, too": fraction("pose_right"),
        "pose, object known": fraction("alone_pose_right"),
        "refused, when left out": fraction("refused"),
        "path until right, median": value("path_until_right", "{:.2f}", " m", never=True),
        "expected calibration error": text("calibration_error", "{:.3f}"),
        "CPU a frame, over one known object's": value("cpu_ratio", "{:.2f}"),
    },
)
"""Columns on how well objects of a catalogue are identified, of a row of `identification_row`."""
_EXPLORED: dict[str, Form] = {
    "converged right": fraction("right"),
    "converged wrong": fraction("wrong"),
    "said alike": fraction("alike"),
    "path until right, median": value("path_m", "{:.0f}", " mm", never=True, scale=1e3),
    "over that of random": text("path_ratio", "{:.2f}"),
    "answers within, CPU": text("asked_ms", "{:.0f} ms"),
    "simulated time until right, median": value("seconds", "{:.0f}", " s"),
    "gel pressed in by": text("indented_mm", "{:.2f} mm"),
    "by more than 1.5 mm": text("too_deep"),
    "more along its axis": text("deep_along"),
}


def _of_event(form: Form) -> Form:
    """Return a form that gives a dash if the slides have no event."""
    return lambda row: "-" if is_missing(row.get("soon.share")) else form(row)


_OBSERVED: dict[str, Form] = {
    "observer knows": fraction("known"),
    "filter knows": fraction("filter_known"),
    "only the observer": fraction("only_observer"),
    "observer's path, median": value("path_m", "{:.0f}", " mm", never=True, scale=1e3),
    "filter's": value("filter_path_m", "{:.0f}", " mm", never=True, scale=1e3),
    "filter's over it, median": value("path_ratio", "{:.2f}", never=True),
    "known again after 20 frames": _of_event(fraction("soon")),
    "by the filter": _of_event(fraction("filter_soon")),
    "path again, filter's over it": _of_event(value("again_ratio", "{:.2f}", never=True)),
    "right when sure": fraction("sure_right", 1),
    "the filter": fraction("filter_sure_right", 1),
}


def identification_row(summary: dict) -> dict:
    """Return a summary of `midastouch identify` as a row."""
    trials = summary["known"] if summary["enough"] else min(summary["known"], summary["unknown"])
    return {"trials": trials} | {key: one for key, one in summary.items() if key != "answers"}


def identification() -> pd.DataFrame:
    """Table of how well objects of a catalogue are identified, from the newest reports."""
    names = {"identify": "the ten", "identify_cad": "CAD parts", "identify_all": "all 78 of YCB"}
    return IDENTIFICATION.of(rows_of(names, lambda name: identification_row(report(name)["identification"])), "report")


def _exploration_rows(content: dict) -> list[dict]:
    """Return rows on the path of a finger until its pose is known, by policy and object, and over all objects."""
    return [
        {"what": content["config"]["policies"][name], "object": what} | each
        for name, one in summarise_exploration(content["trials"]).items()
        for what, each in [*one["objects"].items(), ("all", {key: one[key] for key in one if key != "objects"})]
    ]


def exploration_table(content: dict) -> pd.DataFrame:
    """Table of an `evaluate-exploration` result."""
    about = {"finger goes": text("what"), "object": text("object"), "trials": text("trials")}
    return Table(about | _EXPLORED).of(_exploration_rows(content))


def exploration() -> pd.DataFrame:
    """Table of fingers that follow suggestions where to touch next, and of one that touches at random."""
    names = [name for name in ("exploration", "exploration_arm") if name in reported()] or ["exploration"]
    rows = rows_of(
        dict.fromkeys(names, "-"),
        lambda name: [row for row in _exploration_rows(report(name)) if row["object"] == "all"],
    )
    return Table({"finger goes": text("what"), "trials": text("trials")}, _EXPLORED).of(rows, "report")


def observing_table(content: dict) -> pd.DataFrame:
    """Table of an `ideal-observer` result, a row for each kind of evidence that the observer uses."""
    names = {"maps": "penetration maps", "codes": "codes"}
    rows = ({"what": names[name]} | one for name, one in content["ideal_observer"].items())
    return Table({"compared by": text("what"), "slides": text("trials")}, _OBSERVED).of(rows)


def observing() -> pd.DataFrame:
    """Table of the reports, a row for each condition of the slides; the observer compares penetration maps."""
    nothing = STARTS["accuracy_uniform"]
    names = {
        "observer_uniform": nothing,
        "observer_kidnap": CONDITIONS["kidnap"],
        "observer_cad": f"{nothing}; CAD parts",
    }
    rows = rows_of(names, lambda name: report(name)["ideal_observer"]["maps"])
    return Table({"conditions": text("what")}, _OBSERVED).of(rows, "report")


_HALTED = "... of these over an edge, into a corner, off the object"
_WITHIN, _IN_TIME = 0.5, 2  # bounds: mm off the wanted depth, periods of control
_MOTION = Table(
    {"motion": text("what"), "trials": text("trials")},
    {
        "ended as wanted": fraction("success"),
        "ended with a reason": text("ended"),
        "at the wanted depth": fraction("held", 1),
        "gel pressed in by more than 1.5 mm": text("too_deep"),
        "by": text("indented", "{:.2f} mm"),
        "more than 1.5 mm along its axis": text("deep_along"),
        "contact lost where the surface goes on": fraction("lost", 1),
    },
)
_FAULTS = Table({"fault": text("what"), "trials": text("trials"), "stopped in time": text("in_time")})


def motion() -> pd.DataFrame:
    """Table of how an arm touches and slides, from the newest report."""
    return motion_table(report("motion")) if "motion" in reported() else _MOTION.of(rows_of({"motion": "-"}), "report")


def faults() -> pd.DataFrame:
    """Table of how an arm stops after faults, from the newest report."""
    return fault_table(report("motion") if "motion" in reported() else {"trials": []})


def motion_table(content: dict) -> pd.DataFrame:
    """Table of how an arm touches and slides, of an `evaluate-motion` result."""
    depth_mm = content["config"]["depth_mm"]
    touches, slides, ended = (_of_kind(content, kind) for kind in ("touches", "slide", "faults"))
    of_touches, of_slides = Figures.by_seed(touches), Figures.by_seed(slides)
    held = of_touches.fraction([abs(each["depth_mm"] - depth_mm) <= _WITHIN for each in touches])
    held_sliding = of_slides.fraction([each["held"] for each in slides], [each["images"] for each in slides])
    lost = of_slides.fraction([each["lost"] for each in slides])
    rows = [
        _motion_row("touch", touches) | {"held": held},
        _motion_row("slide", slides) | {"held": held_sliding, "lost": lost},
        _motion_row(_HALTED, [each for each in slides if not each["success"]]),
        _motion_row("slide that a fault ends", ended) | {"success": None},
    ]
    return _MOTION.of(rows)


def fault_table(content: dict) -> pd.DataFrame:
    """Table of faults: how often each happened, and how often the twist was zero within two periods of control."""
    happened: dict[str, list[float]] = {}
    for fault in _of_kind(content, "faults"):
        happened.setdefault(fault["name"], []).append(math.inf if fault["periods"] is None else fault["periods"])
    return _FAULTS.of(
        {"what": name, "trials": len(all_), "in_time": f"{sum(each <= _IN_TIME for each in all_)} of {len(all_)}"}
        for name, all_ in sorted(happened.items())
    )


def _of_kind(content: dict, kind: str) -> list[dict]:
    """Return the results of all motions of a kind, with the labels of their trials."""
    return [
        {"object": trial["object"], "seed": trial["seed"]} | each
        for trial in content["trials"]
        for each in (trial[kind] if isinstance(trial[kind], list) else [trial[kind]])
        if each
    ]


def _motion_row(what: str, motions: list[dict]) -> dict:
    indented = [each["indented_mm"] for each in motions]
    return {
        "what": what,
        "trials": len(motions),
        "success": Figures.by_seed(motions).fraction([each["success"] for each in motions]),
        "ended": f"{sum(each['ended'] for each in motions)} of {len(motions)}",
        "too_deep": too_deep(indented),
        "indented": max(indented, default=math.nan),
        "deep_along": too_deep([each["deepest_mm"] for each in motions]),
    }
