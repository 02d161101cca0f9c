"""Checks of what a file holds."""

from __future__ import annotations

import numpy as np


def finite_array(values: object, shape: tuple[int, ...]) -> np.ndarray:
    """What a file has, as float (*shape); ValueError where it has another shape or is not finite."""
    values = np.asarray(values, float)
    if values.shape != shape or not np.isfinite(values).all():
        raise ValueError(f"shape {values.shape}, need finite {shape}")
    return values
