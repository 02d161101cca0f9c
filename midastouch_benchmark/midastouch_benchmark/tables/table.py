"""One table layer: rows of results and a list of columns; terminal, page and document are three ways to write it.

A *row* holds the figures of one thing that was measured, as numbers; a nested value of a result is named by its path,
`trust.right_at_end.share`. A *form* turns a row into the text of one cell, and a table is a frame of such texts, its
columns named as a reader sees them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from tabulate import tabulate

from midastouch_tools.drawing.page import Page

from ..statistics.intervals import ENOUGH

Row = Mapping[str, Any]
Form = Callable[[Row], object]
UNMEASURED = "*not measured yet*"
_WIDE = 7  # columns from which a table of a few rows is turned upright for a screen
_FEW = 3  # rows


def flat(row: Mapping, prefix: str = "") -> dict[str, Any]:
    """Return a result as a row of a tidy frame: nested values are named by their path."""
    out: dict[str, Any] = {}
    for key, each in row.items():
        out |= flat(each, f"{prefix}{key}.") if isinstance(each, Mapping) else {f"{prefix}{key}": each}
    return out


@dataclass(frozen=True)
class Table:
    """Columns of a table, by label. about: what was measured; claims: figures, which need `ENOUGH` trials. Two columns
    may show one label: give one of the two a space at its end."""

    about: Mapping[str, Form]
    claims: Mapping[str, Form] = field(default_factory=dict)

    def of(self, rows: Iterable[Mapping], sources: str | None = None) -> pd.DataFrame:
        """Return the table of results. A row whose `measured` is false has no claims yet. sources: label of a last
        column with the row's `report`."""
        lines = []
        for row in map(flat, rows):
            line = [form(row) for form in self.about.values()]
            if not row.get("measured", True):
                line += [UNMEASURED, *["-"] * (len(self.claims) - 1)][: len(self.claims)]
            elif self.claims and row["trials"] < ENOUGH:
                line += [f"too few ({row['trials']:.0f})"] * len(self.claims)
            else:
                line += [form(row) for form in self.claims.values()]
            if sources:
                line.append(f"[{row['report']}]" if row.get("measured", True) else f"`{row['report']}`")
            lines.append(line)
        labels = [*self.about, *self.claims, *([sources] if sources else [])]
        return pd.DataFrame(lines, columns=list(map(str.strip, labels)), dtype=object)


def with_row(table: pd.DataFrame, cells: Mapping[str, object] | None) -> pd.DataFrame:
    """Return a table with a last row of finished cells by label, such as the paper's; None: the table itself."""
    return table if cells is None else pd.concat([table, pd.DataFrame([cells])], ignore_index=True).fillna("-")


def listed(labels: tuple[str, ...], rows: Iterable[Sequence]) -> pd.DataFrame:
    """Return a table of finished cells, such as a list of quantities with a value each."""
    return pd.DataFrame(list(rows), columns=list(labels), dtype=object)


def upright(table: pd.DataFrame) -> pd.DataFrame:
    """Return a wide table of a few rows with its columns as rows; any other table unchanged."""
    if len(table.columns) < _WIDE or len(table) > _FEW:
        return table
    turned = table.to_numpy().T.tolist()
    lines = [[label, *cells] for label, cells in zip(table.columns[1:], turned[1:], strict=True)]
    return pd.DataFrame(lines, columns=[table.columns[0], *map(str, turned[0])], dtype=object)


def terminal(table: pd.DataFrame) -> str:
    """Return a table as text for a screen: padded columns, the first one aligned left, the others right."""
    table = upright(table)
    align = ("left", *["right"] * (len(table.columns) - 1))
    return tabulate(
        table.astype(str).to_numpy().tolist(), list(table.columns), "simple", disable_numparse=True, colalign=align
    ) if len(table) else "  ".join(map(str, table.columns))  # fmt: skip


def shown(tables: Iterable[tuple[str, pd.DataFrame]]) -> str:
    """Return tables with their titles as text for a terminal."""
    return "\n\n".join(f"{title}\n{terminal(table)}".strip() for title, table in tables)


def on_page(page: Page, table: pd.DataFrame) -> None:
    """Add a table to a page, as HTML and Markdown."""
    table = upright(table)
    page.table(list(table.columns), table.to_numpy().tolist())


def markdown(table: pd.DataFrame) -> str:
    """Return a table as Markdown for a document; not padded, so that a changed figure changes one line."""
    lines = [list(table.columns), ["---"] * len(table.columns), *table.to_numpy().tolist()]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def is_missing(value: object) -> bool:
    """Return whether a value is None or nan, like a figure that a result lacks."""
    return value is None or value != value


def text(key: str, form: str = "{}") -> Form:
    """Form of a value; a dash if it is missing."""
    return lambda row: "-" if is_missing(row.get(key)) else form.format(row[key])


def several(form: str, unit: str, *keys: str) -> Form:
    """Form of several values in one cell."""
    return lambda row: "; ".join(str(text(key, form)(row)) for key in keys) + unit


def percent(key: str, digits: int = 0) -> Form:
    """Form of a fraction in percent."""
    return lambda row: "-" if is_missing(row.get(key)) else f"{100 * row[key]:.{digits}f} %"


def part(key: str) -> Callable[[Row], str]:
    """Form of a number of trials, of all trials."""
    return lambda row: f"{row[key]:.0f} of {row['trials']:.0f}"


def pose(prefix: str, statistic: str, interval: str | None = None) -> Callable[[Row], str]:
    """Form of an error in mm and deg, `<prefix>_trans_mm.<statistic>` and `<prefix>_rot_deg.<statistic>`; interval: key
    of the interval in mm."""

    def form(row: Row) -> str:
        errors = [row.get(f"{prefix}_{unit}{statistic and '.' + statistic}") for unit in ("trans_mm", "rot_deg")]
        if any(map(is_missing, errors)):
            return "-"
        words = "{:.1f} mm, {:.1f} deg".format(*errors)
        return f"{words} ({between(row.get(interval), '{:.1f}')} mm)" if interval else words

    return form


def fraction(key: str, digits: int = 0) -> Form:
    """Form of a fraction with its 95 % interval: `<key>.share` and `<key>.interval`."""

    def form(row: Row) -> str:
        if is_missing(row.get(f"{key}.share")):
            return "-"
        return f"{100 * row[f'{key}.share']:.{digits}f} % ({between(row[f'{key}.interval'], f'{{:.{digits}%}}')})"

    return form


def value(key: str, form: str, unit: str = "", never: bool = False, scale: float = 1.0) -> Callable[[Row], str]:
    """Form of a value with its 95 % interval: `<key>.value` and `<key>.interval`, times `scale`. never: a missing value
    is infinite."""

    def words(row: Row) -> str:
        number = row.get(f"{key}.value")
        if is_missing(number) and not never:
            return "-"
        return f"{_or_never(number, form, scale)}{unit} ({between(row.get(f'{key}.interval'), form, scale)})"

    return words


def between(interval: list[float] | None, form: str, scale: float = 1.0) -> str:
    """Return the bounds of an interval, times `scale`, as text."""
    return "-" if is_missing(interval) else "...".join(_or_never(bound, form, scale) for bound in interval)


def _or_never(number: float | None, form: str, scale: float) -> str:
    """Return a number as text; a missing one was infinite, since result files store None for infinity."""
    return "never" if is_missing(number) or math.isinf(number) else form.format(scale * number)
