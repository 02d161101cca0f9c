"""Messages of any type with one field that nobody should send."""

from __future__ import annotations

import array
import re

import numpy as np

_FLOATS = (0.0, np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300)
_TEXTS = ("", "nowhere", "/", "x" * 10_000, "Ä\n\t", "base_link")


def spoil(msg, rng: np.random.Generator):
    """Replace one field of a message, at any depth, by an extreme value of its type; returns the message."""
    fields = msg.get_fields_and_field_types()
    if not fields:
        return msg
    name = str(rng.choice(list(fields)))
    setattr(msg, name, _spoilt(getattr(msg, name), fields[name], rng))
    return msg


def _spoilt(value, kind: str, rng: np.random.Generator):
    if hasattr(value, "get_fields_and_field_types"):
        return spoil(value, rng)
    if isinstance(value, np.ndarray):  # of fixed length
        value = value.copy()
        value[rng.integers(len(value))] = _float(kind, rng)
        return value
    if kind.startswith("sequence"):
        return _spoilt_sequence(value, kind, rng)
    if kind.startswith(("double", "float")):
        return _float(kind, rng)
    if kind.startswith("string"):
        return str(rng.choice(_TEXTS))
    if kind == "boolean":
        return not value
    signed, bits = re.fullmatch(r"(u?)int(\d+)", kind).groups()
    low, high = (0, 2 ** int(bits) - 1) if signed else (-(2 ** (int(bits) - 1)), 2 ** (int(bits) - 1) - 1)
    return int(rng.choice([low, 0, 1, high]))


def _spoilt_sequence(values, kind: str, rng: np.random.Generator):
    """Emptied, cut, doubled, or with one spoilt element."""
    way = rng.integers(4)
    if way < 3 or not len(values):
        return (values[:0], values[: len(values) // 2], values + values)[min(way, 2)]
    at = int(rng.integers(len(values)))
    if isinstance(values, array.array):
        if values.typecode in "fd":
            values[at] = _float(kind, rng)
        return values
    values[at] = _spoilt(values[at], kind[len("sequence<") :].rstrip(">"), rng)
    return values


def _float(kind: str, rng: np.random.Generator) -> float:
    value = float(rng.choice(_FLOATS))
    with np.errstate(over="ignore"):
        return float(np.float32(value)) if "float" in kind else value
