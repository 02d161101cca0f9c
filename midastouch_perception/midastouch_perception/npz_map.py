"""The arrays of an uncompressed `.npz` where they lie on the disk: only what is looked at is read."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import numpy as np

_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_LENGTHS = 26  # byte of a member's local header where the lengths of its name and its extra field stand (ZIP, 4.3.7)


def mapped_npz(path: str | Path) -> dict[str, np.ndarray]:
    """Arrays by name, mapped read-only. Raises ValueError for one that is compressed or holds objects."""
    out = {}
    with zipfile.ZipFile(path) as archive, Path(path).open("rb") as stream:
        for member in archive.infolist():
            if member.compress_type != zipfile.ZIP_STORED:
                raise ValueError(f"{member.filename} is compressed")
            stream.seek(member.header_offset + _LENGTHS)
            stream.seek(sum(struct.unpack("<HH", stream.read(4))), 1)
            shape, fortran, dtype = _HEADERS[np.lib.format.read_magic(stream)](stream)
            if dtype.hasobject:
                raise ValueError(f"{member.filename} holds objects")
            order = "F" if fortran else "C"
            name = member.filename.removesuffix(".npy")
            empty = not np.prod(shape, dtype=int)  # nothing to map
            out[name] = np.empty(shape, dtype) if empty else np.memmap(path, dtype, "r", stream.tell(), shape, order)
    return out
