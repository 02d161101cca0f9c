"""Milliseconds per stage, by a clock that the caller provides."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Stopwatch:
    """Times named stages with `clock`, a function that returns seconds (`time.perf_counter`)."""

    def __init__(self, clock: Callable[[], float]):
        self._clock = clock
        self.restart()

    def restart(self) -> None:
        """Begin anew, with no time spent."""
        self.ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent inside to the stage's milliseconds."""
        start = self._clock()
        yield
        self.ms[name] = self.ms.get(name, 0.0) + 1000.0 * (self._clock() - start)
