"""Wall and processor time of repeated calls."""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np


class CallTimer:
    """Timer of blocks run under `with stopwatch:`, by wall time and process CPU time, in milliseconds."""

    def __init__(self) -> None:
        self.wall_ms: list[float] = []
        self.cpu_ms: list[float] = []

    def __enter__(self) -> CallTimer:
        self._cpu = time.process_time()
        self._wall = time.perf_counter()
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.wall_ms.append(1e3 * (time.perf_counter() - self._wall))
            self.cpu_ms.append(1e3 * (time.process_time() - self._cpu))

    def drop(self, first: int) -> None:
        """Forget the first measurements, in which things are loaded."""
        del self.wall_ms[:first], self.cpu_ms[:first]

    def where(self, chosen: Sequence[bool]) -> CallTimer:
        """Return the measurements whose `chosen` is true."""
        out = CallTimer()
        out.wall_ms, out.cpu_ms = (list(itertools.compress(ms, chosen)) for ms in (self.wall_ms, self.cpu_ms))
        return out

    def summary(self) -> dict[str, float]:
        """Return {"p50", "p95", "cpu"} in milliseconds: wall time, and mean CPU time, which counts every thread and is
        reliable on a busy machine."""
        return {
            "p50": round(float(np.percentile(self.wall_ms, 50)), 4),
            "p95": round(float(np.percentile(self.wall_ms, 95)), 4),
            "cpu": round(float(np.mean(self.cpu_ms)), 4),
        }


def time_calls(call: Callable[[], object], repeats: int, warm_up: int = 2) -> CallTimer:
    """Run `call` `repeats` times after `warm_up` untimed calls (caches)."""
    for _ in range(warm_up):
        call()
    stopwatch = CallTimer()
    for _ in range(repeats):
        with stopwatch:
            call()
    return stopwatch


def peak_rss_mb() -> float:
    """Return the largest resident memory of this process so far, MiB. (`getrusage` counts its parent's at the fork.)"""
    return int(re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
