"""Reports that are made again: their plan, and the driver that carries it out and continues where it was stopped.

The reports whose figures stand on the pages that a user reads come first, then the others, each group in the order of
`COMMANDS`.

Each report is made by the very command that its table names. The commands themselves keep finished trials; unfinished
reports are kept apart, and only a complete one replaces the committed one.
"""

from __future__ import annotations

import datetime
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_tools.result_file import read_json

from ..tables.documents import headline
from ..tables.reports import COMMANDS, NO_ESTIMATES, ROOT, fingerprint_of, reported, stale

KEPT = Path("out/evidence")
"""Folder of unfinished reports."""
_SHARED_OUT = tuple(
    f"midastouch {name}" for name in ("benchmark", "identify", "ideal-observer", "evaluate-exploration")
)
"""Commands whose trials run in parallel, and continue where they were stopped."""


@dataclass(frozen=True)
class Step:
    """One report. name; command: as of `COMMANDS`; headline: whether a user reads its figures; state: of its newest
    file: "today", the fingerprint of other code, "unknown" or "missing"."""

    name: str
    command: str
    headline: bool
    state: str


def plan(names: list[str] | None = None) -> list[Step]:
    """Return every report on estimates, or those of these names, the most important first."""
    there, first = reported(), headline()
    states = dict.fromkeys(there, "today") | {name: fingerprint_of(name) or "unknown" for name in stale(there)}
    ordered = [*first, *(name for name in COMMANDS if name not in first)]
    return [
        Step(name, COMMANDS[name], name in first, states.get(name, "missing"))
        for name in ordered
        if name in (names or COMMANDS) and name not in NO_ESTIMATES
    ]


_LEFT = ("missing_trials", "missing_slides")
_OURS = re.compile(r"(?<!\S)midastouch ")


def carry_out(steps: list[Step], jobs: int, minutes: float | None = None) -> list[str]:
    """Make these reports until the time is up; return the names of those that failed.

    A failed command is reported, and the next one follows.
    """
    end = time.monotonic() + 60 * minutes if minutes else None
    failed = []
    for number, step in enumerate(steps):
        print(f"{step.name} ({number + 1} of {len(steps)})")
        if end is not None and time.monotonic() >= end:
            print(f"the time is up; the same command continues with {step.name}")
            break
        try:
            whole = _make(step, jobs, None if end is None else max((end - time.monotonic()) / 60, 0.1))
        except InputError as error:
            print(error)
            failed.append(step.name)
            continue
        if not whole:
            print(f"{step.name}: not all trials are done; the same command continues with it")
            break
    return failed


def _make(step: Step, jobs: int, minutes: float | None) -> bool:
    """Run one command; return whether its report is complete, and replaces earlier ones. InputError if it fails."""
    made = KEPT / f"{step.name}.json"
    made.parent.mkdir(parents=True, exist_ok=True)
    made.unlink(missing_ok=True)
    ended = subprocess.run(["bash", "-c", command_line(step, made, jobs, minutes)], cwd=ROOT, check=False)
    if ended.returncode or not (ROOT / made).is_file():
        raise InputError(f"{step.name}: exit {ended.returncode} of: {step.command}; mend that, and start again")
    if any(read_json(ROOT / made).get(key) for key in _LEFT):
        return False
    place = ROOT / "reports" / datetime.date.today().isoformat() / made.name
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(ROOT / made, place)
    for earlier in set((ROOT / "reports").glob(f"*/{made.name}")) - {place}:
        earlier.unlink()
    return True


def command_line(step: Step, made: Path, jobs: int, minutes: float | None) -> str:
    """Return the shell command that writes the report to a file."""
    words = _OURS.sub(f"{sys.executable} -m midastouch_tools.cli ", step.command)
    if step.command.startswith(_SHARED_OUT):
        words += f" --jobs {jobs}" + (f" --minutes {minutes:.1f}" if minutes else "")
    return f"{words} --json {made}"
