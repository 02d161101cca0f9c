"""Figures of docs/evaluation.md: each is a cell of a table of reports/README.md, so that both pages agree."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from . import accuracy, comparisons, exploring, perception, speed, trust
from .reports import reported
from .table import UNMEASURED, listed

FIGURES = (
    ("error of the particles, start as the paper's", accuracy.localisation, "accuracy", "particles, mean"),
    ("right at the end, nothing known at the start", accuracy.localisation, "accuracy_uniform", "right"),
    ("the same on ten further objects", accuracy.localisation, "uniform_held_out", "right"),
    (
        "pose right at the end on shorter slides, in any state: this filter",
        comparisons.baselines, "as shipped", "pose right",
    ),
    ("... the paper's filter, on the same trials", comparisons.baselines, "the paper's filter", "pose right"),
    (
        "of `converged` frames, wrong, nothing known at the start",
        trust.converged, "accuracy_uniform", "of converged frames, wrong",
    ),
    ("... the tool is 2 mm, 2 deg off", trust.converged, "tool_bias", "of converged frames, wrong"),
    ("truth in the 95 % region of `converged` frames", trust.regions, "accuracy", "95 %, `converged`"),
    (
        "frames until right again: object moved by 50 mm while nothing touched it",
        trust.events, "kidnap", "frames until right again, median",
    ),
    ("right answer to which of ten objects it is", exploring.identification, "identify", "right at the end"),
    (
        "path of a finger that goes where `suggest_motion` says, until right",
        exploring.exploration, "exploration", "path until right, median",
    ),
    ("first pose on an object without a codebook, after", speed.start, "start", "pose after, median"),
    (
        "error through the light of two calibrated real sensors, over that in the training's light",
        perception.real, "real_sensor_calibrated", "mean error over TACTO's",
    ),
    (
        "depth read from presses of a real DIGIT, over the ball's",
        perception.presses, "presses_d20641_calibrated", "deepest",
    ),
    ("image to pose at 60 images a second, median; 99th percentile", speed.load, "load_eyebolt", "image to pose"),
)  # fmt: skip
"""Label, table, row (its report, or how its first cell begins) and column (how its label begins) of each figure."""
_OTHER_REPORT = {comparisons.baselines: "peers"}
"""Report of a table whose rows name none."""


def figures() -> pd.DataFrame:
    """Table of the figures: number, label, figure with its interval, and report."""
    rows = (
        (number, what, _cell(table, row, column), f"[{_report(table, row)}]")
        for number, (what, table, row, column) in enumerate(FIGURES, start=1)
    )
    return listed(("", "what", "figure (95 % interval)", "report"), rows)


def reports() -> set[str]:
    """Return the names of the reports that the figures come from."""
    return {_report(table, row) for _, table, row, _ in FIGURES}


def _report(table: Callable[[], pd.DataFrame], row: str) -> str:
    return _OTHER_REPORT.get(table, row)


def _cell(table: Callable[[], pd.DataFrame], row: str, column: str) -> str:
    if _report(table, row) not in reported():
        return UNMEASURED
    try:
        words = table()
    except FileNotFoundError:  # the table needs a second report, too
        return UNMEASURED
    named = (words.iloc[:, -1] == f"[{row}]") | words.iloc[:, 0].astype(str).str.startswith(row)
    return words.loc[named, next(label for label in words.columns if label.startswith(column))].iloc[0]
