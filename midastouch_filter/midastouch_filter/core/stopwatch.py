"""Milliseconds per stage, by a clock that the caller provides."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager


class Stopwatch:
    """Times named stages with `clock`, a function that returns seconds (`time.perf_counter`)."""

    def __init__(self, clock: Callable[[], float]):
        self.clock = clock
        self.restart()

    def restart(self) -> None:
        """Begin anew, with no time spent."""
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
