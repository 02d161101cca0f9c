from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from midastouch_filter.core import memory


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.skipif("glibc" not in os.confstr("CS_GNU_LIBC_VERSION"), reason="another C library has no malloc_trim")
def test_freed_memory_goes_back_to_the_system():
    """Small blocks, each second one kept: glibc itself gives nothing back of such."""
    blocks = [np.ones(4000) for _ in range(6000)]
    kept = blocks[::2]
    del blocks
    before = resident_mb()
    memory.trim()
    assert before - resident_mb() > 50
    assert len(kept) == 3000
