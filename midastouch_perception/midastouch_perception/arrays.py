"""Checks of arrays from files."""

from __future__ import annotations

import numpy as np


def finite_array(values: object, shape: tuple[int, ...]) -> np.ndarray:
    """Return values from a file as float (*shape); ValueError if they have another shape or are not finite."""
    values = np.asarray(values, float)
    if values.shape != shape or not np.isfinite(values).all():
        raise ValueError(f"shape {values.shape}, need finite {shape}")
    return values
