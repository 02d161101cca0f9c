"""Plan of the reports to make again: their order, and their times.

The reports whose figures stand on the pages that a user reads come first, then the others, each group in the order of
`COMMANDS`. The time of a report is that of the last time it was made here; without one, its trials give an estimate.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from ..tables.documents import headline
from ..tables.reports import COMMANDS, NO_ESTIMATES, fingerprint_of, report, reported, stale

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
    old = set(stale(there))
    ordered = [*first, *(name for name in COMMANDS if name not in first)]
    return [
        Step(name, COMMANDS[name], name in first, _state(name, there, old), _seconds(name, there))
        for name in ordered
        if name in (names or COMMANDS) and name not in NO_ESTIMATES
    ]


def _state(name: str, there: list[str], old: set[str]) -> str:
    if name not in there:
        return "missing"
    return (fingerprint_of(name) or "unknown") if name in old else "today"


def measured_seconds() -> dict[str, float]:
    """Return the times of reports that were made here, in seconds of one core, by name."""
    return json.loads(_SECONDS.read_text()) if _SECONDS.is_file() else {}


def remember_seconds(name: str, seconds: float) -> None:
    """Keep the time that a report took."""
    _SECONDS.parent.mkdir(parents=True, exist_ok=True)
    _SECONDS.write_text(json.dumps(measured_seconds() | {name: seconds}, indent=1))


def _seconds(name: str, there: list[str]) -> float:
    if name in (known := measured_seconds()):
        return known[name]
    if name not in there:
        return _UNKNOWN
    content = report(name)
    return _of_trials(content.get("trials") or []) or _UNKNOWN


def _of_trials(trials: list[dict]) -> float:
    """Return the seconds of one core, by the times and paths in the trials; 0 if they have none."""
    total = 0.0
    for trial in trials:
        if "filter_cpu_ms" in trial:
            total += _OVERHEAD * 1e-3 * trial["filter_cpu_ms"] * trial["frames"]
        elif "cpu_ms" in trial:
            total += 2 * 1e-3 * trial["cpu_ms"] * _FRAMES_PER_M * trial["length_m"]
        elif "path_m" in trial:
            total += _EXPLORED * _FRAMES_PER_M * trial["path_m"]
    return total
