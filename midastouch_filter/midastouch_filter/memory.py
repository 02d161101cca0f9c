"""Memory that was freed, handed back to the system."""

from __future__ import annotations

import ctypes


def trim() -> None:
    """Give back what the C library keeps of freed memory, where it can (glibc).

    Building a filter takes four times what it keeps, and glibc would hold on to most of the rest.
    """
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if malloc_trim is not None:
        malloc_trim(ctypes.c_size_t(0))
