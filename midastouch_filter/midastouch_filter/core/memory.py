"""Memory that was freed, handed back to the system."""

from __future__ import annotations

import ctypes


def trim() -> None:
    """Give back what the C library keeps of freed memory, where it can (glibc): 75 MiB once a filter is built."""
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if malloc_trim is not None:
        malloc_trim(ctypes.c_size_t(0))
