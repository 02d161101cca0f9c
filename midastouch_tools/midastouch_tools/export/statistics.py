"""Running minimum, maximum, mean and standard deviation of values."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping

import numpy as np


class RowStatistics:
    """Statistics of rows, by name of the value: of each element of a value, or of each colour of an image.

    images: names of the values that are images (H, W, 3) uint8, whose full brightness counts as 1.
    """

    def __init__(self, images: Collection[str]):
        self._images, self._rows = images, 0
        self._of: dict[str, _Running] = defaultdict(_Running)

    def add(self, row: Mapping[str, np.ndarray]) -> None:
        """Add a row."""
        self._rows += 1
        for name, value in row.items():
            # the pixels of an image are samples of its colours, which the format wants as (3, 1, 1)
            self._of[name].add(value.reshape(-1, 3, 1, 1) / 255 if name in self._images else value[None])

    def summary(self) -> dict[str, dict[str, list]]:
        """min, max, mean, std (of the population) and count of the rows by name, as lists."""
        return {
            name: {
                "min": one.least.tolist(),
                "max": one.greatest.tolist(),
                "mean": one.mean.tolist(),
                "std": np.sqrt(one.squares / one.count).tolist(),
                "count": [self._rows],
            }
            for name, one in self._of.items()
        }


class _Running:
    """Least, greatest and mean of samples so far, and the sum of their squared deviations from the mean."""

    def __init__(self) -> None:
        self.count = 0
        self.least, self.greatest = np.asarray(np.inf), np.asarray(-np.inf)
        self.mean = self.squares = np.asarray(0.0)

    def add(self, samples: np.ndarray) -> None:
        """Add samples (K, ...) by the update of Chan, Golub and LeVeque (1979), exact also for large stamps."""
        samples = np.asarray(samples, np.float64)
        self.least = np.minimum(self.least, samples.min(axis=0))
        self.greatest = np.maximum(self.greatest, samples.max(axis=0))
        mean, before = samples.mean(axis=0), self.count
        self.count += len(samples)
        off = mean - self.mean
        self.squares = self.squares + ((samples - mean) ** 2).sum(axis=0) + off**2 * before * len(samples) / self.count
        self.mean = self.mean + off * len(samples) / self.count
