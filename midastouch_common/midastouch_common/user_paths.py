"""Paths as users write them."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError


def expanded(path: str | Path, parameter: str) -> Path:
    """The path with `~` as the home directory; InputError naming the parameter where there is none."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise InputError(f"{parameter}: {path}: {error}; give the whole path") from error
