"""Driver that makes the reports of a plan, one after the other, and continues where it was stopped.

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
from collections.abc import Callable
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_tools.result_file import read_json

from ..tables.reports import ROOT
from .plan import KEPT, Step, remember_seconds

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
            say(f"the time is up; the same command goes on with {step.name}")
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
            say(f"{step.name}: not all trials are done; the same command goes on with it")
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
