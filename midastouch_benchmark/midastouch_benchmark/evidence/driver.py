"""Makes the reports of a plan, one after the other, and goes on where it was stopped.

Each report is made by the very command that its table names. Finished trials are kept by the commands themselves, a
report in the making beside them, and only a whole one takes the place of the committed one.
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

from midastouch_bringup.result_file import read_json
from midastouch_common.errors import InputError

from ..tables.reports import ROOT
from .plan import KEPT, Step, remember_seconds

Say = Callable[[str], object]
_LEFT = ("missing_trials", "missing_slides")
_OURS = re.compile(r"(?<!\S)midastouch ")


def carry_out(steps: list[Step], jobs: int, minutes: float | None = None, say: Say = print) -> list[str]:
    """Make these reports, until the time is up; names of those that failed.

    A command that fails is said, and the next one goes on.
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
        # what was resumed took less than the whole would
        remember_seconds(step.name, max(took * (jobs if step.shared_out else 1), step.seconds / 2))
    return failed


def _make(step: Step, jobs: int, minutes: float | None) -> bool:
    """Run one command; whether its report is whole, in the place of earlier ones. InputError if the command fails."""
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
    """What a shell is given to write the report to a file."""
    words = _OURS.sub(f"{sys.executable} -m midastouch_bringup.cli ", step.command)
    if step.shared_out:
        words += f" --jobs {jobs}" + (f" --minutes {minutes:.1f}" if minutes else "")
    return f"{words} --json {made}"


def in_words(seconds: float) -> str:
    """Such as "2 h 10 min"."""
    minutes = max(round(seconds / 60), 1)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
