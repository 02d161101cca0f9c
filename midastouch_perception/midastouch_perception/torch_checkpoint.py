"""Read the tensors of a PyTorch checkpoint, as `torch.save` writes it, without PyTorch.

The names, shapes and types of the tensors stand in a pickle, their content in raw blocks beside it. A pickle is a
program: the only names it may call here are inert stand-ins for PyTorch's tensors, all else is refused.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_common.errors import InputError

from .restricted_unpickler import RestrictedUnpickler

_BFLOAT16 = "bfloat16"
_TYPES = {
    "DoubleStorage": "<f8",
    "FloatStorage": "<f4",
    "HalfStorage": "<f2",
    "BFloat16Storage": _BFLOAT16,
    "LongStorage": "<i8",
    "IntStorage": "<i4",
    "ShortStorage": "<i2",
    "CharStorage": "<i1",
    "ByteStorage": "<u1",
    "BoolStorage": "?",
}
# where training scripts put the state dict, if the file holds more than that
_STATE_KEYS = ("state_dict", "model_state_dict", "model")


class _Mapping(dict):
    """Stand-in for `OrderedDict`: attributes set on it are dropped."""

    def __setstate__(self, state: object) -> None:
        pass


class _Storage:
    """A raw block: its key, the type code of its numbers, how many there are."""

    def __init__(self, key: str, code: str, count: int):
        self.key, self.code, self.count = str(key), code, int(count)

    @property
    def item_size(self) -> int:
        return 2 if self.code == _BFLOAT16 else np.dtype(self.code).itemsize

    def decode(self, raw: bytes) -> np.ndarray:
        """The block's numbers (count,)."""
        if len(raw) != self.count * self.item_size:
            raise InputError(f"block {self.key} has {len(raw)} bytes, needs {self.count * self.item_size}; cut short")
        if self.code == _BFLOAT16:  # the upper half of a float32
            return (np.frombuffer(raw, "<u2").astype("<u4") << 16).view("<f4")
        return np.frombuffer(raw, self.code)


class _Tensor:
    """Stand-in for a tensor: a strided window on a block."""

    def __init__(self, storage: _Storage, offset: int, shape: tuple, stride: tuple, *_: object):
        self.storage, self.offset, self.shape, self.stride = storage, offset, shape, stride

    def array(self, numbers: np.ndarray) -> np.ndarray:
        """The tensor's values, a copy; InputError if the window leaves the block."""
        if len(self.shape) != len(self.stride) or min((self.offset, *self.shape, *self.stride)) < 0:
            raise InputError(f"tensor of shape {self.shape} and stride {self.stride}")
        count = math.prod(self.shape)
        last = self.offset + sum((n - 1) * step for n, step in zip(self.shape, self.stride, strict=True))
        if count and (last >= len(numbers) or count > len(numbers)):
            raise InputError(f"tensor of shape {self.shape} in a block of {len(numbers)} numbers")
        strides = [step * numbers.itemsize for step in self.stride]
        return np.lib.stride_tricks.as_strided(numbers[self.offset :], self.shape, strides).copy()


def _parameter(tensor: _Tensor, *_: object) -> _Tensor:
    return tensor


_ALLOWED: dict[str, Any] = {
    "collections.OrderedDict": _Mapping,
    "torch._utils._rebuild_tensor_v2": _Tensor,
    "torch._utils._rebuild_parameter": _parameter,
    **{f"torch.{name}": code for name, code in _TYPES.items()},
}


class _Unpickler(RestrictedUnpickler):
    def persistent_load(self, pid: Any) -> _Storage:
        kind, code, key, _, count, *view = pid
        if kind != "storage" or any(part is not None for part in view):
            raise InputError("holds views of storages, of a PyTorch before 0.4; save it again with a newer one")
        return _Storage(key, code, count)


def _unpickle(data: bytes) -> Any:
    return _Unpickler(data, _ALLOWED, "but only tensors are read; save model.state_dict() alone").load()


def read_tensors(path: Path) -> dict[str, np.ndarray]:
    """{name: values} of the state dict in a checkpoint: the zip archive that PyTorch writes since 1.6.

    Raises InputError: not such a checkpoint, cut short, foreign classes (named), no state dict in it.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            return _read(archive)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    # Crafted or damaged bytes make the unpickler fail in any way, MemoryError and RecursionError included.
    except Exception as error:
        raise InputError(f"{path}: not a complete PyTorch checkpoint ({error}); get the file again") from error


def _read(archive: zipfile.ZipFile) -> dict[str, np.ndarray]:
    (index,) = (name for name in archive.namelist() if name.rpartition("/")[2] == "data.pkl")
    folder = index.removesuffix("data.pkl")

    def content(name: str) -> bytes:
        entry = archive.getinfo(folder + name)
        if entry.compress_type != zipfile.ZIP_STORED:  # torch.save never does; a bomb would
            raise InputError(f"{entry.filename} is compressed; save it again with torch.save")
        return archive.read(entry)

    if f"{folder}byteorder" in archive.namelist() and content("byteorder") != b"little":
        raise InputError("big-endian; save it again on a common machine")
    state = _state_dict(_unpickle(content("data.pkl")))
    return {name: t.array(t.storage.decode(content(f"data/{t.storage.key}"))) for name, t in state.items()}


def _state_dict(content: Any) -> dict[str, _Tensor]:
    """The mapping of tensors in a checkpoint: the whole content or one of its usual entries."""
    if not isinstance(content, dict):
        raise InputError(f"holds a {type(content).__name__}, not a state dict; save model.state_dict()")
    for state in (content, *(content.get(key) for key in _STATE_KEYS)):
        if isinstance(state, dict):
            tensors = {str(name): value for name, value in state.items() if isinstance(value, _Tensor)}
            if tensors:
                return tensors
    raise InputError(f"holds no state dict, only {', '.join(map(str, content)) or 'nothing'}; save model.state_dict()")
