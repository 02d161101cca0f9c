"""Tables of the documents from the committed reports.

.venv/bin/python -m midastouch_benchmark.tables.documents

A table stands between `<!-- table NAME -->` and `<!-- end -->`; the rest of a document is not changed. If a report was
made several times, the newest counts: `reports/<date>/NAME.json`.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import pandas as pd

from . import accuracy, checks, comparisons, exploring, perception, speed, trust
from .reports import (
    COMMANDS,
    CONDITIONS,
    NO_ESTIMATES,
    ROOT,
    STARTS,
    fingerprint_of,
    further,
    ids_of_today,
    names_read,
    only_of_today,
    report,
    report_path,
    reported,
    stale,
)
from .table import UNMEASURED, listed, markdown

HEADLINE = ("README.md", "docs/evaluation.md", "docs/trust.md")
"""Pages that a user reads; their tables have figures of today's code only."""
ARCHIVE = "reports/README.md"
"""Page that shows every report; figures of earlier code are marked."""
DOCUMENTS = (*HEADLINE, "docs/arm_motion.md", ARCHIVE)
"""Every document with generated tables; a table may stand in several."""


def commands() -> pd.DataFrame:
    """Table of the command that made each report."""
    made_by = {name: re.sub(r" --json \S+", "", report(name).get("command") or COMMANDS[name]) for name in reported()}
    return listed(("report", "made by"), ((f"[{name}]", f"`{command}`") for name, command in made_by.items()))


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


TABLES = {
    table.__name__: table
    for table in (
        accuracy.paper, accuracy.localisation, accuracy.areas, accuracy.slides,
        comparisons.grasps, comparisons.pinches, comparisons.variants, comparisons.front,
        figures,
        trust.converged, trust.weights, trust.regions, trust.events, trust.foreign, trust.shapes, trust.camera_faults,
        exploring.identification, exploring.exploration, exploring.observing, exploring.motion, exploring.faults,
        perception.real, perception.depth, perception.labels, perception.presses, perception.wanted,
        perception.soft_gel, perception.commanded_depth, perception.single_touch, perception.single_touch_limit,
        checks.checks, checks.diameters, checks.contacts, checks.brightness, checks.slow_light, checks.ramps,
        checks.gels, speed.speed, speed.scaling, speed.start, speed.load, speed.soak, commands,
    )
} | {"peers": comparisons.baselines}  # fmt: skip
"""Tables by NAME in their mark."""


def filled(document: str) -> str:
    """Return the text of a document with its tables made again."""
    up = "../" * (len((ROOT / document).relative_to(ROOT).parts) - 1)

    def table(match: re.Match) -> str:
        text, names = (marked if document == ARCHIVE else of_today)(TABLES[match[2]])
        for name in names:
            text = text.replace(f"[{name}]", f"[{name}]({up}{report_path(name).relative_to(ROOT).as_posix()})")
        return f"{match[1]}{text}\n{match[3]}"

    return _TABLE.sub(table, (ROOT / document).read_text())


_TABLE = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", flags=re.S)
MARK = "\u2020"
"""Mark of a row whose report was made by other code than today's."""


def marked(make: Callable[[], pd.DataFrame]) -> tuple[str, list[str]]:
    """Return a table as Markdown, with marked rows and a footnote if reports are stale, and the names of its reports:
    those in the table or, if it names none, those that were read to make it."""
    with names_read() as read:
        table = make()
    text = markdown(table)
    named = [name for name in reported() if f"[{name}]" in text]
    names = named or sorted(read)
    old = stale(names)
    if old and not named:
        table.iloc[:, 0] = [f"{cell} {MARK}" for cell in table.iloc[:, 0]]
        text = markdown(table)
    for name in old:
        text = text.replace(f"[{name}]", f"[{name}] {MARK}")
    return (f"{text}\n\n{_footnote(names, old)}" if old else text), names


def of_today(make: Callable[[], pd.DataFrame]) -> tuple[str, list[str]]:
    """Return a table as Markdown from today's reports, with a line on the missing ones; names of its reports."""
    names = marked(make)[1]
    try:
        with only_of_today():
            text = markdown(make())
    except FileNotFoundError:  # the whole table needs that report
        text = UNMEASURED
    left = [f"[{name}]" for name in stale(names)]
    rest = f"; not measured with it yet, last figures by earlier code: {', '.join(left)}" if left else ""
    return f"{text}\n\nFigures of today's code{rest}.", names


def _footnote(names: list[str], old: list[str]) -> str:
    """Return the footnote of a table of these reports, some of them stale."""
    of_old = sorted({fingerprint_of(name) or "unknown" for name in old})
    now = ", ".join(f"`{each}`" for each in ids_of_today().values()) or "none"
    said = f"{MARK} measured with earlier code, fingerprint {', '.join(of_old)}; today's: {now}."
    mixed = len(of_old) > 1 or len(old) < len(set(names) - set(NO_ESTIMATES))
    return f"{said} Rows of several fingerprints stand here: they are not of one filter." if mixed else said


def headline() -> list[str]:
    """Return the names of the reports whose figures stand, or will stand, on the pages of `HEADLINE`."""
    names = {*STARTS, *CONDITIONS, *further()}
    for document in HEADLINE:
        for match in _TABLE.finditer((ROOT / document).read_text()):
            names.update(marked(TABLES[match[2]])[1])
    return [name for name in COMMANDS if name in names]


if __name__ == "__main__":
    for name in DOCUMENTS:
        (ROOT / name).write_text(filled(name))
