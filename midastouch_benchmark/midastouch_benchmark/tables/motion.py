"""Tables of how an arm touches and slides, and how it stops."""

from __future__ import annotations

import math

import pandas as pd

from ..statistics.intervals import Figures
from .reports import report, reported, rows_of
from .table import Table, fraction, text

_HALTED = "... of these over an edge, into a corner, off the object"
_WITHIN, _DEEPEST, _IN_TIME = 0.5, 1.5, 2  # bounds: mm off the wanted depth, mm deep, periods of control
_MOTION = Table(
    {"motion": text("what"), "trials": text("trials")},
    {
        "ended as wanted": fraction("success"),
        "ended with a reason": text("ended"),
        "at the wanted depth": fraction("held", 1),
        "deeper than 1.5 mm": text("too_deep"),
        "deepest": text("deepest", "{:.2f} mm"),
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
    trials, depth_mm = content["trials"], content["config"]["depth_mm"]
    slides = [trial for trial in trials if trial["slide"]]
    touches, slid = [trial["touch"] for trial in trials], [trial["slide"] for trial in slides]
    of_touches, of_slides = Figures.by_seed(trials), Figures.by_seed(slides)
    held = of_touches.fraction([abs(each["depth_mm"] - depth_mm) <= _WITHIN for each in touches])
    held_sliding = of_slides.fraction([each["held"] for each in slid], [each["images"] for each in slid])
    lost = of_slides.fraction([each["lost"] for each in slid])
    halted = [trial for trial in slides if not trial["slide"]["success"]]
    rows = [
        _row("touch", touches, of_touches) | {"held": held},
        _row("slide", slid, of_slides) | {"held": held_sliding, "lost": lost},
        _row(_HALTED, [trial["slide"] for trial in halted], Figures.by_seed(halted)),
    ]
    return _MOTION.of(rows)


def fault_table(content: dict) -> pd.DataFrame:
    """Table of faults: how often each happened, and how often the twist was zero within two periods of control."""
    happened: dict[str, list[float]] = {}
    for fault in (trial["fault"] for trial in content["trials"]):
        if fault:
            happened.setdefault(fault["name"], []).append(math.inf if fault["periods"] is None else fault["periods"])
    return _FAULTS.of(
        {"what": name, "trials": len(all_), "in_time": f"{sum(each <= _IN_TIME for each in all_)} of {len(all_)}"}
        for name, all_ in happened.items()
    )


def _row(what: str, motions: list[dict], figures: Figures) -> dict:
    deepest = [each["deepest_mm"] for each in motions]
    return {
        "what": what,
        "trials": len(motions),
        "success": figures.fraction([each["success"] for each in motions]),
        "ended": f"{sum(each['ended'] for each in motions)} of {len(motions)}",
        "too_deep": f"{sum(depth > _DEEPEST for depth in deepest)} of {len(deepest)}",
        "deepest": max(deepest, default=math.nan),
    }
