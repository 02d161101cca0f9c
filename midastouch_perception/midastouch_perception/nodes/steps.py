"""Penetration in steps that survive a cloud's float32."""

from __future__ import annotations

import numpy as np

# Metres. Far below what the depth network can tell apart, far above what a cloud loses.
_STEP = np.float32(1e-6)


def in_steps(penetration: np.ndarray) -> np.ndarray:
    """Penetration rounded to 1 um: exactly the same whether it came as an array or through a cloud.

    Without it the two would differ in the last bit, which a particle filter turns into another random run.
    """
    return np.rint(penetration / _STEP) * _STEP
