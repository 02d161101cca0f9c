"""Result files: JSON, strict (no NaN), written whole or not at all."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, require_file

DIGITS = 4
"""Significant digits of the figures of a report."""


def to_json(value: object, digits: int | None = None) -> Any:
    """`value` in JSON's own types: NumPy scalars and arrays converted, non-finite numbers become null; floats with so
    many significant digits, None: all."""
    if isinstance(value, dict):
        return {str(key): to_json(item, digits) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json(item, digits) for item in value]
    if isinstance(value, np.ndarray):
        return to_json(value.tolist(), digits)
    if isinstance(value, np.generic):
        return to_json(value.item(), digits)
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return value if digits is None else float(f"{value:.{digits}g}")
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value


def write_json(path: str | os.PathLike, value: object) -> None:
    """Write `value` to `path`; a failure leaves the former file."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(to_json(value), indent=1, allow_nan=False) + "\n")


def write_compact_json(path: str | os.PathLike, value: dict) -> None:
    """Write `value` to `path` in few bytes: one line per key, or per item of a list of objects, and floats of `DIGITS`
    significant digits."""
    parts = []
    for key, item in to_json(value, DIGITS).items():
        if isinstance(item, list) and item and isinstance(item[0], dict):
            text = "[\n" + ",\n".join(json.dumps(one, allow_nan=False) for one in item) + "\n]"
        else:
            text = json.dumps(item, allow_nan=False)
        parts.append(f"{json.dumps(key)}: {text}")
    with atomic_path(path) as temporary:
        temporary.write_text("{\n" + ",\n".join(parts) + "\n}\n")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value


def read_json(path: str | os.PathLike) -> dict:
    """Return the object in a result file; InputError if it is not one."""
    path = require_file(path, "result")
    try:
        value = json.loads(Path(path).read_text(), parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a JSON file ({error}); give a file written by --json") from error
    if not isinstance(value, dict):
        raise InputError(f"{path}: holds a {type(value).__name__}, not an object; give a file written by --json")
    return value
