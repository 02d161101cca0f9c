"""Threads for kernels that release the GIL, and return of freed memory to the system.

Kernels work on a range of particles in one thread; the ranges go to a small thread pool, which several Python threads
may use at once.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

CHUNKS = 8
"""Number of ranges a parallel loop is cut into. Fixed, so that sums do not depend on the number of threads."""

_WORTH_A_THREAD = 4096  # items; handing over a range costs about 20 us, as much as a few hundred particles


class Workers:
    """Thread pool of `threads` threads (0: one per available core) for kernels and functions."""

    def __init__(self, threads: int = 0):
        available = len(os.sched_getaffinity(0))
        self.threads = threads or available
        self._pool = ThreadPoolExecutor(max(self.threads - 1, 1), "filter")  # starts its threads when they are needed

    def run(self, n: int, kernel: Callable[[int, int, int], None]) -> None:
        """Call `kernel(low, high, chunk)` on at most CHUNKS disjoint ranges that cover [0, n), until all are done.

        The ranges depend on n alone, never on the number of threads.
        """
        if n < _WORTH_A_THREAD:
            kernel(0, n, 0)
            return
        bounds = [n * c // CHUNKS for c in range(CHUNKS + 1)]
        self._distribute(CHUNKS, lambda c: kernel(bounds[c], bounds[c + 1], c))

    def map(self, function: Callable[[T], R], items: list[T]) -> list[R]:
        """Return `function` of each item, in their order. It pays from about 100 us per item without the GIL."""
        out: dict[int, R] = {}
        self._distribute(len(items), lambda k: out.__setitem__(k, function(items[k])))
        return [out[k] for k in range(len(items))]

    def _distribute(self, count: int, do: Callable[[int], None]) -> None:
        """Call `do` with each of [0, count), in whichever thread is free, until all are done.

        So no call waits for a thread that gets no processor.
        """
        left = iter(range(count))  # the interpreter hands each number out once

        def work() -> None:
            for k in left:
                do(k)

        pending = [self._pool.submit(work) for _ in range(min(self.threads, count) - 1)]
        work()
        for future in pending:
            if not future.cancel():
                future.result()


def trim() -> None:
    """Give back freed memory that the C library keeps, if it can (glibc): 75 MiB once a filter is built."""
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if malloc_trim is not None:
        malloc_trim(ctypes.c_size_t(0))
