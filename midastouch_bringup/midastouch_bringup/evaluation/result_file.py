"""Result files: JSON, strict (no NaN), written whole or not at all."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np

from midastouch_perception.errors import InputError
from midastouch_perception.files import atomic_path, require_file


def to_json(value: object) -> object:
    """`value` in JSON's own types: NumPy scalars and arrays converted, non-finite numbers become null."""
    if isinstance(value, dict):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json(item) for item in value]
    if isinstance(value, np.ndarray):
        return to_json(value.tolist())
    if isinstance(value, np.generic):
        return to_json(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value


def write_json(path: str | os.PathLike, value: object) -> None:
    """Write `value` to `path`; a failure leaves what was there before."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(to_json(value), indent=1, allow_nan=False) + "\n")


def read_json(path: str | os.PathLike) -> dict:
    """The object in a result file; InputError when it is not one."""
    path = require_file(path, "result")
    try:
        value = json.loads(Path(path).read_text())
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a JSON file ({error}); give a file written by --json") from error
    if not isinstance(value, dict):
        raise InputError(f"{path}: holds a {type(value).__name__}, not an object; give a file written by --json")
    return value
