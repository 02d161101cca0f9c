"""Which objects of a large catalogue may explain touches, by a few typical codes of each.

The codes of an object are put into groups, and the mean of a group stands for it (Lloyd 1982). A touch speaks for an
object as its most similar typical code does. That does not say where on the object it is, nor whether the next touch
fits there, too; it says which objects are worth the comparison that does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_TYPICAL = 128
_ROUNDS = 5


def typical_codes(codes: np.ndarray) -> np.ndarray:
    """(T, D) unit codes that stand for codes (M, D), the first of which are spread over the object as evenly as all."""
    typical = codes[:_TYPICAL]
    for _ in range(_ROUNDS):
        group = (codes @ typical.T).argmax(axis=1)
        held = np.unique(group)
        starts = np.searchsorted(np.sort(group), held)
        sums = np.add.reduceat(codes[np.argsort(group, kind="stable")], starts)
        typical = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
    return typical


class CoarseIndex:
    """Typical codes of N objects, for each (T, D); temperature and outlier, the calibration of codes."""

    def __init__(self, typical: Sequence[np.ndarray], temperature: float, outlier: float):
        self._codes = np.concatenate(typical)
        self._starts = np.cumsum([0, *map(len, typical[:-1])])
        self._temperature, self._outlier = temperature, outlier

    def log_ratios(self, codes: np.ndarray) -> np.ndarray:
        """(N, K) nats that touches with unit codes (K, D) speak for each object, against any of them."""
        best = np.maximum.reduceat(self._codes @ codes.T, self._starts, axis=0)
        likelihood = np.exp((best - best.max(axis=0)) / self._temperature)
        return np.log((1 - self._outlier) * likelihood / likelihood.mean(axis=0) + self._outlier)
