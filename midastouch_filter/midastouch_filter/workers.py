"""Threads for kernels that release the GIL.

Kernels work on a range of particles in one thread; the ranges go to a small thread pool, that may be used from
several Python threads at once.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T, R = TypeVar("T"), TypeVar("R")

CHUNKS = 8
"""Number of ranges a parallel loop is cut into. Fixed, so that sums do not depend on the number of threads."""

_WORTH_A_THREAD = 4096  # items; handing over a range costs about 20 us, as much as a few hundred particles


class Workers:
    """Runs `kernel(low, high, chunk)` over [0, n) on `threads` threads (0: one per available core)."""

    def __init__(self, threads: int = 0):
        available = len(os.sched_getaffinity(0))
        self.threads = threads or available
        self._pool = ThreadPoolExecutor(self.threads - 1, "filter") if self.threads > 1 else None

    def run(self, n: int, kernel: Callable[[int, int, int], None]) -> None:
        """Call the kernel on at most CHUNKS disjoint ranges that cover [0, n); returns when all are done.

        How [0, n) is cut depends on n alone, never on the number of threads.
        """
        if n < _WORTH_A_THREAD:
            kernel(0, n, 0)
            return
        bounds = [n * c // CHUNKS for c in range(CHUNKS + 1)]

        def share(first: int) -> None:
            for c in range(first, CHUNKS, self.threads):
                kernel(bounds[c], bounds[c + 1], c)

        pending = [self._pool.submit(share, k) for k in range(1, self.threads)] if self._pool else []
        share(0)
        for future in pending:
            future.result()

    def map(self, function: Callable[[T], R], items: list[T]) -> list[R]:
        """`function` of each item, in their order. Worth it from about 100 us an item that holds no lock."""
        if not self._pool or len(items) < 2:
            return [function(item) for item in items]
        pending = [self._pool.submit(function, item) for item in items[1:]]
        return [function(items[0]), *(future.result() for future in pending)]
