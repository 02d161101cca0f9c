"""Reports that are made again: their plan, and the driver that carries it out and continues where it was stopped.

The reports whose figures stand on the pages that a user reads come first, then the others, each group in the order of
`COMMANDS`. The time of a report is that of the last time it was made here; without one, its trials give an estimate.

Each report is made by the very command that its table names. The commands themselves keep finished trials; unfinished
reports are kept apart, and only a complete one replaces the committed one.
"""

from __future__ import annotations

import datetime
import json
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_tools.result_file import read_json

from ..tables.documents import headline
from ..tables.reports import COMMANDS, NO_ESTIMATES, ROOT, fingerprint_of, report, reported, stale

KEPT = Path("out/evidence")
"""Folder of unfinished reports, and of the times that reports made here have taken."""
_SECONDS = KEPT / "seconds.json"
_OVERHEAD = 1.6  # of a trial's filter time: errors over all particles, reading, disturbing
_FRAMES_PER_M = 667.0  # of a simulated slide
_EXPLORED = 0.05  # s of one core a frame that is rendered, perceived and filtered
_UNKNOWN = 600.0  # s, of a report without trials
_SHARED_OUT = tuple(
    f"midastouch {name}" for name in ("benchmark", "identify", "ideal-observer", "evaluate-exploration")
)


@dataclass(frozen=True)
class Step:
    """One report. name; command: as of `COMMANDS`; headline: whether a user reads its figures; state: of its newest
    file: "today", the fingerprint of other code, "unknown" or "missing"; seconds: that one core needs for it."""

    name: str
    command: str
    headline: bool
    state: str
    seconds: float

    @property
    def shared_out(self) -> bool:
        """True if its trials run in parallel, and continue where they were stopped."""
        return self.command.startswith(_SHARED_OUT)

    def takes(self, jobs: int) -> float:
        """Return the seconds that it takes with `jobs` processes."""
        return self.seconds / (jobs if self.shared_out else 1)


def plan(names: list[str] | None = None) -> list[Step]:
    """Return every report on estimates, or those of these names, the most important first."""
    there, first = reported(), headline()
    states = dict.fromkeys(there, "today") | {name: fingerprint_of(name) or "unknown" for name in stale(there)}
    ordered = [*first, *(name for name in COMMANDS if name not in first)]
    return [
        Step(name, COMMANDS[name], name in first, states.get(name, "missing"), _seconds(name, there))
        for name in ordered
        if name in (names or COMMANDS) and name not in NO_ESTIMATES
    ]


def measured_seconds() -> dict[str, float]:
    """Return the times of reports that were made here, in seconds of one core, by name."""
    return json.loads(_SECONDS.read_text()) if _SECONDS.is_file() else {}


def remember_seconds(name: str, seconds: float) -> None:
    """Keep the time that a report took."""
    _SECONDS.parent.mkdir(parents=True, exist_ok=True)
    _SECONDS.write_text(json.dumps(measured_seconds() | {name: seconds}, indent=1))


def _seconds(name: str, there: list[str]) -> float:
    """Return the seconds of one core, as measured here, or by the times and paths in the trials."""
    if name in (known := measured_seconds()):
        return known[name]
    if name not in there:
        return _UNKNOWN
    total = 0.0
    for trial in report(name).get("trials") or []:
        if "filter_cpu_ms" in trial:
            total += _OVERHEAD * 1e-3 * trial["filter_cpu_ms"] * trial["frames"]
        elif "cpu_ms" in trial:
            total += 2 * 1e-3 * trial["cpu_ms"] * _FRAMES_PER_M * trial["length_m"]
        elif "path_m" in trial:
            total += _EXPLORED * _FRAMES_PER_M * trial["path_m"]
    return total or _UNKNOWN


Say = Callable[[str], object]
_LEFT = ("missing_trials", "missing_slides")
_OURS = re.compile(r"(?<!\S)midastouch ")


def carry_out(steps: list[Step], jobs: int, minutes: float | None = None, say: Say = print) -> list[str]:
    """Make these reports until the time is up; return the names of those that failed.

    A failed command is reported, and the next one follows.
    """
    end = time.monotonic() + 60 * minutes if minutes else None
    failed = []
    for number, step in enumerate(steps):
        left = sum(each.takes(jobs) for each in steps[number:])
        say(f"{step.name} ({number + 1} of {len(steps)}); about {in_words(left)} left")
        if end is not None and time.monotonic() >= end:
            say(f"the time is up; the same command continues with {step.name}")
            break
        began = time.monotonic()
        try:
            whole = _make(step, jobs, None if end is None else max((end - began) / 60, 0.1))
        except InputError as error:
            say(str(error))
            failed.append(step.name)
            continue
        took = time.monotonic() - began
        if not whole:
            say(f"{step.name}: not all trials are done; the same command continues with it")
            break
        # a resumed report takes less time than a whole one
        remember_seconds(step.name, max(took * (jobs if step.shared_out else 1), step.seconds / 2))
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
    if step.shared_out:
        words += f" --jobs {jobs}" + (f" --minutes {minutes:.1f}" if minutes else "")
    return f"{words} --json {made}"


def in_words(seconds: float) -> str:
    """Return a duration as text, such as "2 h 10 min"."""
    minutes = max(round(seconds / 60), 1)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
