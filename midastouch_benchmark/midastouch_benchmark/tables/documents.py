"""The tables of README.md, docs/evaluation.md, docs/trust.md and reports/README.md from the committed reports.

.venv/bin/python -m midastouch_benchmark.tables.documents

A table stands between `<!-- table NAME -->` and `<!-- end -->`; only that is rewritten. Of a report that was made
several times the newest counts: `reports/<date>/NAME.json`.
"""

from __future__ import annotations

import re

from . import accuracy, exploring, figures, perception, speed, trust
from .reports import COMMANDS, ROOT, Table, report, report_path, reported

DOCUMENTS = ("README.md", "docs/evaluation.md", "docs/trust.md", "reports/README.md")


def commands() -> Table:
    """What made each report."""
    return ["report", "made by"], [[f"[{name}]", f"`{_made_by(name)}`"] for name in reported()]


def figure_commands() -> Table:
    """What made those that the figures of docs/evaluation.md come from."""
    header, rows = commands()
    return header, [row for row in rows if row[0].strip("[]") in figures.reports()]


def _made_by(name: str) -> str:
    """The command that the report names itself, without where it wrote to; that of `COMMANDS` if it names none."""
    return re.sub(r" --json \S+", "", report(name).get("command") or COMMANDS[name])


TABLES = {
    table.__name__: table
    for table in (
        accuracy.paper, accuracy.localisation, accuracy.widths, accuracy.areas,
        accuracy.start, accuracy.codebooks, accuracy.grasps, accuracy.peers, accuracy.variants, accuracy.front,
        accuracy.slides, figures.figures, figure_commands,
        trust.converged, trust.weights, trust.regions, trust.events,
        exploring.identification, exploring.shapes, exploring.exploration, exploring.twins,
        perception.real, perception.depth, perception.labels, perception.presses, perception.wanted, perception.checks,
        perception.diameters, perception.contacts, perception.brightness, perception.single_touch,
        speed.speed, speed.scaling, speed.load, speed.soak, commands,
    )
}  # fmt: skip


def filled(document: str) -> str:
    """The text of a document, its tables made anew."""
    path = ROOT / document
    up = "../" * (len(path.relative_to(ROOT).parts) - 1)

    def table(match: re.Match) -> str:
        header, rows = TABLES[match[2]]()
        lines = [header, ["---"] * len(header), *rows]
        text = "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
        for name in reported():
            text = text.replace(f"[{name}]", f"[{name}]({up}{report_path(name).relative_to(ROOT).as_posix()})")
        return f"{match[1]}{text}\n{match[3]}"

    return re.sub(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", table, path.read_text(), flags=re.S)


if __name__ == "__main__":
    for name in DOCUMENTS:
        (ROOT / name).write_text(filled(name))
