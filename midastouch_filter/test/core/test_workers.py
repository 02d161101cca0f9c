from __future__ import annotations

import os
import threading
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_filter.core import workers
from midastouch_filter.core.workers import CHUNKS, Workers


@given(st.integers(0, 40_000), st.integers(1, 4))
def test_ranges_cover_everything_once_however_many_threads(n, threads):
    seen: list[tuple[int, int]] = []
    Workers(threads).run(n, lambda low, high, chunk: seen.append((low, high)))
    seen.sort()
    assert seen[0][0] == 0
    assert seen[-1][1] == n
    assert all(a[1] == b[0] for a, b in pairwise(seen))
    assert len(seen) in (1, CHUNKS)


@pytest.mark.parametrize("threads", [1, 3])
def test_map_keeps_the_order(threads):
    assert Workers(threads).map(lambda x: x * x, [3, 1, 2]) == [9, 1, 4]
    assert Workers(threads).map(str, []) == []


def test_a_thread_held_up_holds_up_no_other_item():
    others, done = threading.Event(), []

    def each(item):
        if item == 1:
            return others.wait(120)
        done.append(item)
        if len(done) == 7:
            others.set()
        return True

    assert all(Workers(2).map(each, list(range(8))))


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_comes_out(threads):
    with pytest.raises(ZeroDivisionError):
        Workers(threads).map(lambda x: 1 / x, [1, 0])


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.skipif("glibc" not in os.confstr("CS_GNU_LIBC_VERSION"), reason="another C library has no malloc_trim")
def test_freed_memory_goes_back_to_the_system():
    """Small blocks, each second one kept: glibc itself gives nothing back of such."""
    blocks = [np.ones(4000) for _ in range(6000)]
    kept = blocks[::2]
    del blocks
    before = resident_mb()
    workers.trim()
    assert before - resident_mb() > 50
    assert len(kept) == 3000
