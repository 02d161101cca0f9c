"""Read trained weights of other programs: PyTorch checkpoints, safetensors, NumPy archives."""

from __future__ import annotations

import json
import math
import zipfile
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import require_file

from .torch_checkpoint import read_tensors

_SAFETENSORS_TYPES = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "I64": "<i8", "I32": "<i4"}
_HEADER_LIMIT = 100_000_000  # bytes, as the format's own reader has it


def read_checkpoint(path: str | Path) -> dict[str, np.ndarray]:
    """{name: values} of the tensors in a weight file; its format is told by its content.

    Raises InputError: no such file, none of the formats, cut short, holds anything that is not tensors.
    """
    path = require_file(path, "weight")
    with path.open("rb") as stream:
        start = stream.read(9)
    if start.startswith(b"PK"):
        return _read_archive(path)
    if start.startswith(b"\x80"):
        raise InputError(
            f"{path}: a pickle, such as PyTorch before 1.6 wrote; save it again: torch.save(torch.load(FILE), FILE)"
        )
    if start[8:] == b"{":
        return _read_safetensors(path)
    raise InputError(
        f"{path}: begins with {start!r}, not a PyTorch checkpoint, .safetensors or .npz; download it again"
    )


def _read_archive(path: Path) -> dict[str, np.ndarray]:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
        if any(name.endswith("/data.pkl") for name in names):
            return read_tensors(path)
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except InputError:
        raise
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a complete checkpoint ({error}); download it again") from error


def _read_safetensors(path: Path) -> dict[str, np.ndarray]:
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    out = {}
    try:
        if length > min(len(data) - 8, _HEADER_LIMIT):
            raise ValueError(f"header of {length} bytes in a file of {len(data)}")
        header = json.loads(data[8 : 8 + length])
        header.pop("__metadata__", None)
        for name, entry in header.items():
            start, end = (8 + length + int(offset) for offset in entry["data_offsets"])
            raw, shape = data[start:end], tuple(map(int, entry["shape"]))
            code = np.dtype(_SAFETENSORS_TYPES[entry["dtype"]])
            if len(raw) != math.prod(shape) * code.itemsize:
                raise ValueError(f"{name} has {len(raw)} bytes for shape {shape}")
            out[name] = np.frombuffer(raw, code).reshape(shape)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path}: not a complete .safetensors file ({error}); get it again") from error
    return out
