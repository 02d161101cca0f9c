"""A guard for unpickling data of strangers."""

from __future__ import annotations

import pickletools

from .errors import InputError


def refuse_oversized_memo(data: bytes) -> None:
    """Raise InputError if a pickle claims a memo slot beyond its own length.

    A few bytes may claim the slot 2^32 - 1, for which the unpickler would allocate gigabytes.
    """
    for opcode, argument, _ in pickletools.genops(data):
        if opcode.name == "LONG_BINPUT" and argument > len(data):
            raise InputError(f"memo slot {argument} in a file of {len(data)} bytes")
