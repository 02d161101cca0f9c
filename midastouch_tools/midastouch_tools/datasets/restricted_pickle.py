"""Reading of untrusted pickles: NumPy arrays are read, OmegaConf nodes are skipped, everything else is refused.

A pickle is a program. The only names it may call here are the stand-ins below. The stand-ins of arrays check every
size and type before NumPy sees them, since NumPy's own unpickling code trusts its input.
"""

from __future__ import annotations

import io
import pickle
import pickletools
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import readable, require_file

_PLAIN_DTYPE = re.compile(r"[biufcSU]\d*|\?")


class _Dtype:
    """Stand-in for `numpy.dtype`: a type code, and the byte order from the state that follows."""

    def __init__(self, code: str, *_: object) -> None:
        self._code = code
        self._order: Any = "="  # whatever the file says

    def __setstate__(self, state: tuple) -> None:
        self._order = state[1]

    def filled(self, content: Any, shape: tuple, order: Literal["C", "F"]) -> np.ndarray:
        """Return a new array of this type and shape from raw bytes, or from a list of objects."""
        if self._code in ("O", "O8"):
            if not isinstance(content, list):
                raise InputError(f"array of objects of shape {shape} without its objects")
            array: np.ndarray = np.empty(len(content), object)
            for i, item in enumerate(content):
                array[i] = item
        else:
            if not (isinstance(self._code, str) and _PLAIN_DTYPE.fullmatch(self._code)):
                raise InputError(f"array of type {self._code!r}, which is neither plain numbers nor text")
            array = np.frombuffer(content, np.dtype(self._code).newbyteorder(self._order.replace("|", "=")))
        return array.reshape(shape, order=order).copy(order=order)


class _Array(np.ndarray):
    """Stand-in for `numpy.ndarray`, empty until its state is set."""

    def __new__(cls, *_: object) -> _Array:
        return super().__new__(cls, 0)

    def __setstate__(self, state: tuple) -> None:
        _, shape, dtype, fortran, content = state
        # NumPy gets a state that it made itself, from a valid array
        super().__setstate__(dtype.filled(content, shape, "F" if fortran else "C").__reduce__()[2])


class _Skipped:
    """Stand-in for OmegaConf's containers and values, and for the types they mention; nothing here reads them."""

    def __init__(self, *_: object) -> None:
        pass

    def __setstate__(self, state: Any) -> None:
        pass


def _encode(text: str, encoding: str) -> bytes:
    """Stand-in for `_codecs.encode`: protocol 2 writes bytes as Latin-1 text and a call of it."""
    if encoding != "latin1":
        raise InputError(f"text in the encoding {encoding!r} where bytes are written")
    return text.encode("latin1")


_ALLOWED: dict[str, Any] = {
    "numpy.ndarray": _Array,
    "numpy.dtype": _Dtype,
    "collections.defaultdict": _Skipped,
    "typing.Any": _Skipped,
    "_codecs.encode": _encode,
    "__builtin__.bytes": lambda: b"",  # how protocol 2 writes empty bytes
}
for _core in ("numpy.core", "numpy._core"):
    _ALLOWED[f"{_core}.multiarray._reconstruct"] = _Array
    _ALLOWED[f"{_core}.multiarray.scalar"] = lambda dtype, content: dtype.filled(content, (), "C")[()]
    _ALLOWED[f"{_core}.numeric._frombuffer"] = lambda content, dtype, shape, order: dtype.filled(content, shape, order)
for _module, _names in {
    "omegaconf.dictconfig": "DictConfig",
    "omegaconf.listconfig": "ListConfig",
    "omegaconf.base": "ContainerMetadata Metadata",
    "omegaconf.nodes": "AnyNode BooleanNode FloatNode IntegerNode StringNode",
    "builtins": "bool dict float int list str",
    "__builtin__": "bool dict float int list str",
}.items():
    _ALLOWED.update(dict.fromkeys((f"{_module}.{_name}" for _name in _names.split()), _Skipped))


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if f"{module}.{name}" not in _ALLOWED:
            raise InputError(
                f"asks for '{module}.{name}', which is not data (only NumPy arrays and OmegaConf values are)"
            )
        return _ALLOWED[f"{module}.{name}"]


def loads(data: bytes, name: str) -> Any:
    """Return the values pickled in `data`: plain containers, numbers, text and NumPy arrays.

    Raises InputError, with `name` for the data, for anything else: foreign classes (named), truncated or inconsistent
    content.
    """
    try:
        for opcode, slot, _ in pickletools.genops(data):
            if opcode.name in ("PUT", "LONG_BINPUT") and slot > len(data):  # would allocate gigabytes
                raise InputError(f"memo slot {slot} in a file of {len(data)} bytes")
            if opcode.name in ("NEXT_BUFFER", "READONLY_BUFFER"):  # a view of memory that an array may free
                raise InputError("a buffer that is not in the file")
        return _Unpickler(io.BytesIO(data)).load()
    except InputError as error:
        raise InputError(f"{name}: refused, {error}; use a file from a source you trust") from None
    # Crafted or damaged bytes make the unpickler fail in any way, MemoryError and RecursionError included.
    except Exception as error:
        raise InputError(f"{name}: not a complete pickle ({error}); get the file again") from error


def load(path: str | Path) -> Any:
    """Return the content of a pickle file, as `loads` does."""
    path = require_file(path, "data")
    return loads(path.read_bytes(), str(path))


def load_npy(path: str | Path) -> Any:
    """Return the array in a `.npy` file, or the one object of a pickled object array without dimensions."""
    path = require_file(path, "data")
    with path.open("rb") as stream:
        with readable(path, "not a NumPy file", "get the file again"):
            version = np.lib.format.read_magic(stream)
            readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
            dtype = readers[version](stream)[2]
            if not dtype.hasobject:
                stream.seek(0)
                return np.lib.format.read_array(stream, allow_pickle=False)
        array = loads(stream.read(), str(path))
    if not isinstance(array, np.ndarray):
        raise InputError(f"{path}: holds no array; get the file again")
    return array[()] if array.ndim == 0 else array
