"""Unpickle data of strangers: a pickle is a program, here it may call listed names only."""

from __future__ import annotations

import io
import pickle
import pickletools
from collections.abc import Mapping
from typing import Any

from midastouch_common.errors import InputError


class RestrictedUnpickler(pickle.Unpickler):
    """Unpickler of one pickle that resolves the names of a list and no others.

    Args: data, the pickle; allowed, {"module.name": inert stand-in}; only, what the error says about all else.

    Raises InputError: here for a pickle that claims more memory than it is long, in `load` for a name not listed.
    """

    def __init__(self, data: bytes, allowed: Mapping[str, Any], only: str):
        _refuse_oversized_memo(data)
        super().__init__(io.BytesIO(data))
        self._allowed, self._only = allowed, only

    def find_class(self, module: str, name: str) -> Any:
        try:
            return self._allowed[f"{module}.{name}"]
        except KeyError:
            raise InputError(f"asks for '{module}.{name}', {self._only}") from None


def _refuse_oversized_memo(data: bytes) -> None:
    """A few bytes may claim the memo slot 2^32 - 1, for which the unpickler would allocate gigabytes."""
    for opcode, argument, _ in pickletools.genops(data):
        if opcode.name == "LONG_BINPUT" and argument > len(data):
            raise InputError(f"memo slot {argument} in a file of {len(data)} bytes")
