"""Counts of the work that steps skipped, and times of their stages."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import AbstractContextManager

GATES = ("at_rest", "no_contact", "unchanged_code")
"""Names of the gates, each of which recognises work that can be skipped:

at_rest: the arm does not move; no_contact: nothing is touched; unchanged_code: the very same image again, and no new
touch. Also counted: keyframes; descents, alignments to maps; promoted, untested poses that were compared with maps;
hopeless, hypotheses that were not compared because they could no longer matter; born, how often poses all over the
object were added.
"""


class Gates:
    """Counters, by name, of what was skipped, refused or added.

    Args: open_gates, names of `GATES` that skip nothing, to measure what they save.
    Attributes: counts, by name; note, reason of the last refusal of this step, "" if there was none.
    """

    def __init__(self, open_gates: Collection[str] = ()):
        self.counts: dict[str, int] = dict.fromkeys(GATES, 0)
        self.note = ""
        self._open = frozenset(open_gates)

    def skips(self, gate: str, needless: bool) -> bool:
        """Count and return whether to skip work that is `needless`."""
        skip = bool(needless) and gate not in self._open
        self.counts[gate] += skip
        return skip

    def refuse(self, kind: str, reason: str) -> None:
        """Count input that was refused, and note the reason."""
        self.count(kind, 1)
        self.note = reason

    def count(self, kind: str, number: int) -> None:
        """Add `number` to the count of a kind."""
        self.counts[kind] = self.counts.get(kind, 0) + number


class Stopwatch:
    """Timer of named stages; `clock` returns seconds (`time.perf_counter`)."""

    def __init__(self, clock: Callable[[], float]):
        self.clock = clock
        self.restart()

    def restart(self) -> None:
        """Forget all times."""
        self.ms: dict[str, float] = {}

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Return a context that adds the time spent inside to the stage's milliseconds."""
        return _Stage(self, name)


class _Stage(AbstractContextManager):
    # a class, because a generator would cost more time than some stages
    def __init__(self, watch: Stopwatch, name: str):
        self._watch, self._name = watch, name

    def __enter__(self) -> None:
        self._start = self._watch.clock()

    def __exit__(self, *_: object) -> None:
        ms = self._watch.ms
        ms[self._name] = ms.get(self._name, 0.0) + 1000.0 * (self._watch.clock() - self._start)
