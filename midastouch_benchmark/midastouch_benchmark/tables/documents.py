"""The tables of README.md, docs/evaluation.md, docs/trust.md and reports/README.md from the committed reports.

.venv/bin/python -m midastouch_benchmark.tables.documents

A table stands between `<!-- table NAME -->` and `<!-- end -->`; only that is rewritten. Of a report that was made
several times the newest counts: `reports/<date>/NAME.json`.
"""

from __future__ import annotations

import re

import pandas as pd

from . import accuracy, checks, comparisons, exploring, figures, perception, speed, trust
from .reports import COMMANDS, ROOT, report, report_path, reported
from .table import listed, markdown

DOCUMENTS = ("README.md", "docs/evaluation.md", "docs/trust.md", "reports/README.md")
"""Every document with generated tables; a table may stand in several."""


def commands() -> pd.DataFrame:
    """What made each report."""
    return listed(("report", "made by"), ((f"[{name}]", f"`{_made_by(name)}`") for name in reported()))


def figure_commands() -> pd.DataFrame:
    """What made those that the figures of docs/evaluation.md come from."""
    table = commands()
    return table[table["report"].str.strip("[]").isin(figures.reports())]


def _made_by(name: str) -> str:
    """The command that the report names itself, without where it wrote to; that of `COMMANDS` if it names none."""
    return re.sub(r" --json \S+", "", report(name).get("command") or COMMANDS[name])


TABLES = {
    table.__name__: table
    for table in (
        accuracy.paper, accuracy.localisation, accuracy.widths, accuracy.areas, accuracy.slides,
        comparisons.codebooks, comparisons.grasps, comparisons.variants, comparisons.front,
        figures.figures, figure_commands,
        trust.converged, trust.weights, trust.regions, trust.events,
        exploring.identification, exploring.shapes, exploring.exploration,
        perception.real, perception.depth, perception.labels, perception.presses, perception.wanted,
        perception.single_touch, checks.checks, checks.diameters, checks.contacts, checks.brightness,
        speed.speed, speed.scaling, speed.start, speed.load, speed.soak, commands,
    )
} | {"peers": comparisons.baselines, "twins": exploring.alike_objects}  # fmt: skip
"""Tables by the name in their mark."""


def filled(document: str) -> str:
    """The text of a document, its tables made anew."""
    path = ROOT / document
    up = "../" * (len(path.relative_to(ROOT).parts) - 1)

    def table(match: re.Match) -> str:
        text = markdown(TABLES[match[2]]())
        for name in reported():
            text = text.replace(f"[{name}]", f"[{name}]({up}{report_path(name).relative_to(ROOT).as_posix()})")
        return f"{match[1]}{text}\n{match[3]}"

    return re.sub(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", table, path.read_text(), flags=re.S)


if __name__ == "__main__":
    for name in DOCUMENTS:
        (ROOT / name).write_text(filled(name))
