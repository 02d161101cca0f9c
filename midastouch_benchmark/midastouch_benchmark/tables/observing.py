"""Table of how far the filter is from what could be known."""

from __future__ import annotations

import pandas as pd

from .table import Form, Row, fraction, text, tidy, value, written

_COMPARED = {"maps": "penetration maps", "codes": "codes", "both": "maps and codes"}


def _of_event(form: Form) -> Form:
    """A dash where nothing happened on the way."""
    return lambda row: "-" if row.get("soon.share") is None or row["soon.share"] != row["soon.share"] else form(row)


def _millimetres(key: str) -> Form:
    form = value(key, "{:.0f}", " mm", never=True)

    def words(row: Row) -> str:
        low_high = row.get(f"{key}.interval")
        scaled = [bound if bound is None else 1e3 * bound for bound in low_high] if low_high else None
        number = row.get(f"{key}.value")
        return form({f"{key}.value": number if number is None else 1e3 * number, f"{key}.interval": scaled})

    return words


OBSERVING: dict[str, Form] = {
    "observer knows": fraction("known"),
    "filter knows": fraction("filter_known"),
    "only the observer": fraction("only_observer"),
    "observer's path, median": _millimetres("path_m"),
    "filter's": _millimetres("filter_path_m"),
    "filter's over it, median": value("path_ratio", "{:.2f}", never=True),
    "known again after 20 frames": _of_event(fraction("soon")),
    "by the filter": _of_event(fraction("filter_soon")),
    "path again, filter's over it": _of_event(value("again_ratio", "{:.2f}", never=True)),
    "right when sure": fraction("sure_right", 1),
    "the filter": fraction("filter_sure_right", 1),
}


def observing_table(summary: dict[str, dict]) -> pd.DataFrame:
    """By what the observer compares poses with."""
    rows = [{"what": _COMPARED[name], "trials": one["trials"]} | one for name, one in summary.items()]
    return written(tidy(rows), {"compared by": text("what"), "slides": text("trials")}, OBSERVING)
