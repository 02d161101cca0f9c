"""Tables of the filter against the ideal observer."""

from __future__ import annotations

import pandas as pd

from .reports import CONDITIONS, STARTS, frame_of, report
from .table import Form, fraction, is_missing, text, tidy, value, written

_UNIFORM = STARTS["accuracy_uniform"]
_OBSERVED = {
    "observer_uniform": _UNIFORM,
    "observer_kidnap": CONDITIONS["kidnap"],
    "observer_cad": f"{_UNIFORM}; CAD parts",
}
"""Condition of the slides, by the name of the report."""
_COMPARED = {"maps": "penetration maps", "codes": "codes"}


def _of_event(form: Form) -> Form:
    """Return a form that gives a dash if the slides have no event."""
    return lambda row: "-" if is_missing(row.get("soon.share")) else form(row)


OBSERVING: dict[str, Form] = {
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


def observing_table(summary: dict[str, dict]) -> pd.DataFrame:
    """Table of an `ideal-observer` result, a row for each kind of evidence that the observer uses."""
    rows = [{"what": _COMPARED[name], "trials": one["trials"]} | one for name, one in summary.items()]
    return written(tidy(rows), {"compared by": text("what"), "slides": text("trials")}, OBSERVING)


def observing() -> pd.DataFrame:
    """Table of the reports, a row for each condition of the slides; the observer compares penetration maps."""
    frame = frame_of(_OBSERVED, lambda name: report(name)["ideal_observer"]["maps"])
    return written(frame, {"conditions": text("what")}, OBSERVING, "report")
