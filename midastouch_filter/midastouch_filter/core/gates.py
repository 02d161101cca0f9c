"""What a step left out, and how long the rest of it took."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import AbstractContextManager

GATES = ("at_rest", "no_contact", "unchanged_code")
"""Each recognises work that can be skipped:

at_rest: the arm does not move; no_contact: nothing is touched; unchanged_code: the very same image again, and no new
touch. Counted besides: keyframes; descents, alignments to maps; promoted, untested poses that were compared with maps;
hopeless, hypotheses that could not matter any more and were not; born, how often poses all over the object were added;
pushed, how often poses near the leading ones were.
"""


class Gates:
    """Counts what was skipped, refused or added, by name.

    Args: open_gates, names of `GATES` that let everything pass, to see what they are worth.
    Attributes: counts, by name; note, the last refusal of this step in words, "" if there was none.
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
        """Input was refused, for a reason in words."""
        self.count(kind, 1)
        self.note = reason

    def count(self, kind: str, number: int) -> None:
        """Add `number` to the count of a kind."""
        self.counts[kind] = self.counts.get(kind, 0) + number


class Stopwatch:
    """Times named stages with `clock`, a function that returns seconds (`time.perf_counter`)."""

    def __init__(self, clock: Callable[[], float]):
        self.clock = clock
        self.restart()

    def restart(self) -> None:
        """Forget all times."""
        self.ms: dict[str, float] = {}

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Add the time spent inside to the stage's milliseconds."""
        return _Stage(self, name)


class _Stage(AbstractContextManager):
    # a class, because a generator would take longer than some stages
    def __init__(self, watch: Stopwatch, name: str):
        self._watch, self._name = watch, name

    def __enter__(self) -> None:
        self._start = self._watch.clock()

    def __exit__(self, *_: object) -> None:
        ms = self._watch.ms
        ms[self._name] = ms.get(self._name, 0.0) + 1000.0 * (self._watch.clock() - self._start)
