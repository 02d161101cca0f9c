"""Memory of this process."""

from __future__ import annotations

import re
from pathlib import Path


def peak_rss_mb() -> float:
    """Largest resident memory of this process so far, MiB. (`getrusage` counts what its parent had at the fork.)"""
    return int(re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
