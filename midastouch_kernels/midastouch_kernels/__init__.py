"""Compiled inner loops over NumPy arrays. The bindings in `src/` document each of them.

The arrays must have exactly the type and layout that a kernel asks for (C order, float32 or float64, ...): nothing is
converted, so that a kernel writes to your array and not to a copy. Kernels that take long release the GIL.
"""

from __future__ import annotations

import contextlib
import platform
from pathlib import Path

# Instructions of the level x86-64-v3 that the compiler may use and that some processors lack.
_V3 = {"avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "abm"}


def _knows_v3() -> bool:
    """Return whether this processor can run the faster of the two modules."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return False
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("flags"):
                return set(line.split()) >= _V3
    return False


if _knows_v3():
    from ._kernels_v3 import *  # noqa: F403
else:
    from ._kernels import *  # noqa: F403
