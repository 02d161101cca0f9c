"""Arrays from files, and checks of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def finite_array(values: object, shape: tuple[int, ...]) -> np.ndarray:
    """Return values from a file as float (*shape); ValueError if they have another shape or are not finite."""
    values = np.asarray(values, float)
    if values.shape != shape or not np.isfinite(values).all():
        raise ValueError(f"shape {values.shape}, need finite {shape}")
    return values


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a NumPy archive by name; raises any error for a broken one, and for Python objects in it."""
    with np.load(path, allow_pickle=False) as data:
        return dict(data)
