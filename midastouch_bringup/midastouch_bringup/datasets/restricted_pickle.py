"""Read pickled data of strangers: NumPy arrays and OmegaConf nodes become plain values, all else is refused.

A pickle is a program. The only names it may call here are the stand-ins below; they are inert: they keep what
they are given and run neither NumPy's nor OmegaConf's unpickling code on it (both trust their input, and
NumPy's can be led to read outside an array). After loading, stand-ins are turned into arrays and plain
containers, with every size checked.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import require_file
from midastouch_perception.restricted_unpickler import RestrictedUnpickler

_ONLY = "which is not data (only NumPy arrays and OmegaConf values are)"
_PLAIN_DTYPE = re.compile(r"[biufcSU?]\d*")


class _Dtype:
    """Stand-in for `numpy.dtype`: a type code and a byte order."""

    def __init__(self, code: str, *_: object) -> None:
        self.code = code
        self.order = "="

    def __setstate__(self, state: tuple) -> None:
        self.order = state[1]

    def dtype(self) -> np.dtype | None:
        """The plain NumPy type, None for an array of Python objects."""
        code = self.code.decode() if isinstance(self.code, bytes) else self.code
        if code in ("O", "O8"):
            return None
        if not isinstance(code, str) or not _PLAIN_DTYPE.fullmatch(code):
            raise InputError(f"array of type {code!r}, which is neither plain numbers nor text")
        dtype = np.dtype(code)
        return dtype.newbyteorder(self.order) if self.order in ("<", ">") else dtype


class _Array:
    """Stand-in for `numpy.ndarray`: its shape, type and raw content."""

    state: tuple = ()

    def __setstate__(self, state: tuple) -> None:
        self.state = state

    def value(self, resolve: Callable[[Any], Any]) -> np.ndarray:
        _, shape, dtype, fortran, content = self.state
        return _array(content, dtype, shape, "F" if fortran else "C", resolve)


class _Buffer:
    """Stand-in for an array pickled by protocol 5."""

    def __init__(self, content: bytes, dtype: _Dtype, shape: tuple, order: str) -> None:
        self.arguments = (content, dtype, shape, order)

    def value(self, resolve: Callable[[Any], Any]) -> np.ndarray:
        return _array(*self.arguments, resolve)


class _Scalar:
    """Stand-in for a NumPy scalar."""

    def __init__(self, dtype: _Dtype, content: bytes) -> None:
        self.arguments = (dtype, content)

    def value(self, resolve: Callable[[Any], Any]) -> Any:
        dtype, content = self.arguments
        return _array(content, dtype, (), "C", resolve)[()]


class _ConfigNode:
    """Stand-in for OmegaConf's containers, values and their metadata, and for the types they mention."""

    def __init__(self, *_: object) -> None:
        self.state: dict = {}

    def __setstate__(self, state: dict) -> None:
        self.state = state

    def value(self, resolve: Callable[[Any], Any]) -> Any:
        return resolve(self.state.get("_content", self.state.get("_val")))


def _array(content: Any, dtype: _Dtype, shape: tuple, order: str, resolve: Callable[[Any], Any]) -> np.ndarray:
    plain = dtype.dtype()
    size = math.prod(shape)
    if plain is None:
        if not isinstance(content, list) or len(content) != size:
            raise InputError(f"array of objects of shape {shape} without as many objects")
        array = np.empty(size, object)
        array[:] = [resolve(item) for item in content]
        return array.reshape(shape, order=order)
    if isinstance(content, str):
        content = content.encode("latin1")
    if len(content) != size * plain.itemsize:
        raise InputError(f"array of shape {shape} with {len(content)} bytes of content")
    return np.frombuffer(content, plain).reshape(shape, order=order).copy(order=order)


def _reconstruct(*_: object) -> _Array:
    return _Array()


def _empty_dict(*_: object) -> dict:
    return {}


def _empty_bytes() -> bytes:
    """Protocol 2 writes empty bytes as this call."""
    return b""


def _encode(text: str, encoding: str) -> bytes:
    """Protocol 2 writes bytes as text in Latin-1 and this call."""
    if encoding != "latin1":
        raise InputError(f"text in the encoding {encoding!r} where bytes are written")
    return text.encode("latin1")


_ALLOWED: dict[str, Any] = {
    "numpy.ndarray": _Array,
    "numpy.dtype": _Dtype,
    "collections.defaultdict": _empty_dict,
    "_codecs.encode": _encode,
    "__builtin__.bytes": _empty_bytes,
    "typing.Any": _ConfigNode,
    **{
        f"numpy.{core}.{name}": stand_in
        for core in ("core", "_core")
        for name, stand_in in {
            "multiarray._reconstruct": _reconstruct,
            "multiarray.scalar": _Scalar,
            "numeric._frombuffer": _Buffer,
        }.items()
    },
    **{
        f"omegaconf.{name}": _ConfigNode
        for name in (
            "dictconfig.DictConfig",
            "listconfig.ListConfig",
            "base.ContainerMetadata",
            "base.Metadata",
            "nodes.AnyNode",
            "nodes.BooleanNode",
            "nodes.FloatNode",
            "nodes.IntegerNode",
            "nodes.StringNode",
        )
    },
    **{
        f"{builtins}.{name}": _ConfigNode
        for builtins in ("builtins", "__builtin__")
        for name in ("bool", "dict", "float", "int", "list", "str")
    },
}


def _resolve_all(loaded: Any) -> Any:
    """Replace stand-ins by their values, once each, also inside containers."""
    done: dict[int, Any] = {}

    def resolve(item: Any) -> Any:
        key = id(item)
        if key in done:
            return done[key]
        if isinstance(item, dict):
            done[key] = out = {}
            out.update((resolve(k), resolve(v)) for k, v in item.items())
        elif isinstance(item, list):
            done[key] = out = []
            out.extend(map(resolve, item))
        elif isinstance(item, (tuple, set, frozenset)):
            done[key] = type(item)(map(resolve, item))
        elif isinstance(item, (_Array, _Buffer, _Scalar, _ConfigNode)):
            done[key] = item.value(resolve)
        else:
            return item
        return done[key]

    return resolve(loaded)


def loads(data: bytes, name: str) -> Any:
    """Values pickled in `data`: plain containers, numbers, text and NumPy arrays.

    `name` is what the error speaks of. Raises InputError for all else: foreign classes (named), truncated or
    inconsistent content.
    """
    try:
        return _resolve_all(RestrictedUnpickler(data, _ALLOWED, _ONLY).load())
    except InputError as error:
        raise InputError(f"{name}: refused, {error}; use a file from a source you trust") from None
    # Crafted or damaged bytes make the unpickler fail in any way, MemoryError and RecursionError included.
    except Exception as error:
        raise InputError(f"{name}: not a complete pickle ({error}); get the file again") from error


def load(path: str | Path) -> Any:
    """Content of a pickle file, as `loads`."""
    path = require_file(path, "data")
    return loads(path.read_bytes(), str(path))


def load_npy(path: str | Path) -> Any:
    """Content of a `.npy` file: an array; of a pickled array of objects and no dimensions, its one object."""
    path = require_file(path, "data")
    with path.open("rb") as stream:
        try:
            version = np.lib.format.read_magic(stream)
            read_header = {
                (1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0,
            }[version]
            dtype = read_header(stream)[2]
            if not dtype.hasobject:
                stream.seek(0)
                return np.lib.format.read_array(stream, allow_pickle=False)
        except (ValueError, KeyError, EOFError, OSError, MemoryError, OverflowError, SyntaxError, TypeError) as error:
            # a damaged header can name any type and any size
            raise InputError(f"{path}: not a NumPy file ({error}); get the file again") from error
        array = loads(stream.read(), str(path))
    if not isinstance(array, np.ndarray):
        raise InputError(f"{path}: holds no array; get the file again")
    return array[()] if array.ndim == 0 else array
