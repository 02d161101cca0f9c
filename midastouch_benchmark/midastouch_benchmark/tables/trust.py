"""Tables of docs/trust.md: the promises of states and regions, and how often they are kept."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import pandas as pd

from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig

from ..statistics.accuracy import converged_figures, converged_wrong_frames, is_right, pose_right_at_end
from ..statistics.coverage import WEIGHTS
from ..statistics.intervals import Figures
from ..trials.camera_faults import FAULTS
from ..trials.other_shapes import DIFFERENCES
from .reports import CONDITIONS, FURTHER, OPTICS, STARTS, benchmark_summary, further, report, reported, rows_of
from .table import Form, Row, Table, fraction, is_missing, listed, text, value

_WEIGHED = {"accuracy": "start as the paper's", "tool_bias": "tool off", "kidnap": "moved, unreported"}
EVENTS = ("rest", "lift", "kidnap", "jump", "unexplained", "push")
"""Protocols in which something happens on the way."""
PROMISED_WRONG, PROMISED_REGION = 1 - FilterConfig().converged_probability, 0.95
"""Promised bounds: the largest fraction of wrong converged frames, and how often the 95 % region holds the truth."""
_LEVELS = {"50 %": "0.5", "90 %": "0.9", "95 %": "0.95", "99 %": "0.99"}


def conditions() -> dict[str, str]:
    """Return the conditions of the tables: every protocol, and those over further objects and optics with a report."""
    optics = {name: f"light {what}" for name, what in OPTICS.items() if name != "real_plain"}
    there = reported()
    return STARTS | CONDITIONS | {name: what for name, what in (further() | optics).items() if name in there}


def verdict(key: str, limit: float, below: str, above: str, undecided: str) -> Form:
    """Form of the side of a limit on which the whole interval of a fraction lies; `undecided` if it crosses it."""

    def form(row: Row) -> str:
        if is_missing(row.get(f"{key}.interval")):
            return "-"
        low, high = row[f"{key}.interval"]
        return below if high <= limit else above if low > limit else undecided

    return form


_TOGETHER = "all of the ten that follow, but for *another object*"
CONVERGED = Table(
    {"conditions": text("what")},
    {
        "of converged frames, wrong": fraction("trust.converged_frames_wrong", 1),
        f"at most {100 * PROMISED_WRONG:.0f} %": verdict(
            "trust.converged_frames_wrong", PROMISED_WRONG, "kept", "*not kept*", "not shown"
        ),
        "of trials that end `converged`, right": fraction("trust.right_if_converged_at_end"),
        "of `ambiguous` frames, truth among the modes": fraction("trust.ambiguous_frames_among"),
    },
)
"""Columns on how often the state `converged` is right, of a summary."""
REGIONS = Table(
    {"conditions": text("what")},
    {
        **{f"{what}, `converged`": fraction(f"trust.regions.converged.{level}") for what, level in _LEVELS.items()},
        "95 % region of `converged` frames": verdict(
            "trust.regions.converged.0.95", PROMISED_REGION, "*too small*", "too large", "as said"
        ),
        **{f"{what}, right": fraction(f"trust.regions.right.{level}") for what, level in _LEVELS.items()},
    },
)
"""Columns on how often the published covariance holds the truth, of a summary."""
_FOREIGN = Table(
    {"conditions": text("what")},
    {
        "said at the end that another object is touched": fraction("trust.foreign_at_end"),
        "said so ever": fraction("trust.foreign_ever"),
        "at the end right, `ambiguous` with the truth among the modes, or said so": fraction(
            "trust.right_or_said_at_end"
        ),
    },
)
_SHAPES = Table(
    {"what differs": text("what"), "trials": text("trials")},
    {
        "right": fraction("right"),
        "said at the end that another object is touched": fraction("said"),
        "pose right at the end, in any state": fraction("pose"),
    },
)
_CAMERA_FAULTS = Table(
    {
        "fault": text("what"),
        "trials": text("trials"),
        "frames left, mean": text("frames", "{:.0f}"),
        "right at the end": fraction("right"),
        "`converged` and wrong at the end": fraction("wrong_at_end"),
        "frames `converged` and wrong, of all": fraction("wrong", 1),
    }
)
AROUND_EVENT = Table(
    {"event": text("what")},
    {
        "right before it": fraction("trust.right_before_event"),
        "of these, ever `converged` at a wrong pose": fraction("trust.misled"),
        "in how many frames, mean": value("trust.misled_frames.mean", "{:.1f}"),
        "of these, right again after 30 frames": fraction("trust.found_again"),
        "frames until right again, median": value("trust.frames_until_right.median", "{:.0f}", never=True),
    },
)
"""Columns on how often an event misleads the filter, and how long until it is right again, of a summary."""


def weights_table(trusts: Mapping[str, dict]) -> pd.DataFrame:
    """Table of how often a published pose is right, by the weight of its mode; trusts: `trust` figures by label."""
    shown = {label: trust["weights"] for label, trust in trusts.items() if trust["enough"]}
    cell = fraction("right")
    rows = []
    for k, (low, high) in enumerate(pairwise([0.0, *WEIGHTS, 1.0])):
        bins = [weights[k] for weights in shown.values()]
        cells = [cell({f"right.{key}": each for key, each in one["right"].items()}) for one in bins]
        cells = [words if one["frames"] else "-" for words, one in zip(cells, bins, strict=True)]
        rows.append((f"{low:.0%} to {high:.0%}", *cells))
    return listed(("weight of the published mode", *shown), rows)


def converged() -> pd.DataFrame:
    """Table of how often the state `converged` is right, by condition."""
    names = [name for name in (STARTS | CONDITIONS) if name != "wrong_mesh" and name in reported()]
    trials = [trial for name in names for trial in report(name)["trials"]]
    together = {"what": _TOGETHER, "report": "] [".join(names), "trials": len(trials)}
    rows = [together | {"trust": converged_figures(trials)}] if trials else []
    return CONVERGED.of(rows + rows_of(conditions(), benchmark_summary), "report")


def weights() -> pd.DataFrame:
    """Table of how often a published pose is right, by the weight of its mode, from the newest reports."""
    there = reported()
    return weights_table(
        {f"right, {what}": benchmark_summary(name)["trust"] for name, what in _WEIGHED.items() if name in there}
    )


def regions() -> pd.DataFrame:
    """Table of how often the published covariance holds the truth, by condition."""
    return REGIONS.of(rows_of(conditions(), benchmark_summary), "report")


def foreign() -> pd.DataFrame:
    """Table of how often the filter reports that another object than its mesh is touched."""
    return _FOREIGN.of(rows_of(conditions(), benchmark_summary), "report")


def events() -> pd.DataFrame:
    """Table of how often an event misleads the filter, and how long until it is right again, by event."""
    return AROUND_EVENT.of(rows_of({name: CONDITIONS[name] for name in EVENTS}, benchmark_summary), "report")


def shapes() -> pd.DataFrame:
    """Table of slides over objects that differ from their mesh, by the difference, over all sets of objects."""
    names = [name for name in ("other_shape", *(f"other_shape_{objects}" for objects in FURTHER)) if name in reported()]
    trials = [trial for name in names for trial in report(name)["trials"]]
    rows = []
    for k, what in enumerate(DIFFERENCES):
        some = [trial for trial in trials if trial["slide"] % len(DIFFERENCES) == k]
        figures = Figures.by_slide(some)
        said = figures.fraction([trial["final"]["foreign"] for trial in some])
        right = {"right": figures.fraction(list(map(is_right, some))), "said": said, "pose": pose_right_at_end(some)}
        rows.append({"what": what, "trials": len(some), "report": "] [".join(names)} | right)
    return _SHAPES.of(rows if trials else rows_of({"other_shape": "-"}), "reports")


def camera_faults() -> pd.DataFrame:
    """Table of slides with faults of camera, lamps and gel, by fault, and over all."""
    if "camera_faults" not in reported():
        return _CAMERA_FAULTS.of(rows_of({"camera_faults": "-"}), "report")
    trials = report("camera_faults")["trials"]
    groups = {"all": trials} | {
        what: [trial for trial in trials if trial["slide"] % len(FAULTS) == k] for k, what in enumerate(FAULTS)
    }
    return _CAMERA_FAULTS.of(({"what": what} | _fault_row(some) for what, some in groups.items()), "report")


def _fault_row(trials: list[dict]) -> dict:
    figures, frames = Figures.by_slide(trials), [trial["frames"] for trial in trials]
    return {
        "trials": len(trials),
        "report": "camera_faults",
        "frames": sum(frames) / len(trials),
        "right": figures.fraction(list(map(is_right, trials))),
        "wrong_at_end": figures.fraction(
            [trial["final"]["state"] == state.CONVERGED and not is_right(trial) for trial in trials]
        ),
        "wrong": figures.fraction(converged_wrong_frames(trials), frames),
    }
