"""Running minimum, maximum, mean and standard deviation of values."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np


class RowStatistics:
    """Statistics of rows, by name of the value; images: names of the values that are images."""

    def __init__(self, images: Collection[str]):
        self._images = images
        self._of: dict[str, ElementStatistics | ImageStatistics] = {}

    def add(self, row: Mapping[str, np.ndarray]) -> None:
        """Add a row."""
        for name, value in row.items():
            if name not in self._of:
                self._of[name] = ImageStatistics() if name in self._images else ElementStatistics()
            self._of[name].add(value)

    def summary(self) -> dict[str, dict[str, list]]:
        """min, max, mean, std and count by name, as lists."""
        return {
            name: {key: value.tolist() for key, value in one.summary().items()} | {"count": [one.count]}
            for name, one in self._of.items()
        }


class ElementStatistics:
    """Statistics of each element over arrays of one shape, by Welford's update."""

    def __init__(self) -> None:
        self.count = 0
        self._least = self._greatest = self._mean = self._squares = np.asarray(0.0)

    def add(self, values: np.ndarray) -> None:
        """Add an array."""
        values = np.asarray(values, np.float64)
        self.count += 1
        if self.count == 1:
            self._least, self._greatest = values, values
        self._least, self._greatest = np.minimum(self._least, values), np.maximum(self._greatest, values)
        before = values - self._mean
        self._mean = self._mean + before / self.count
        self._squares = self._squares + before * (values - self._mean)

    def summary(self) -> dict[str, np.ndarray]:
        """min, max, mean, std (of the population), each of the values' shape."""
        std = np.sqrt(self._squares / max(self.count, 1))
        return {"min": self._least, "max": self._greatest, "mean": self._mean, "std": std}


class ImageStatistics:
    """Statistics of each colour over the pixels of images (H, W, 3) uint8 of one size; full brightness is 1."""

    def __init__(self) -> None:
        self._least, self._greatest = ElementStatistics(), ElementStatistics()
        self._mean, self._square = ElementStatistics(), ElementStatistics()

    @property
    def count(self) -> int:
        """Number of images so far."""
        return self._mean.count

    def add(self, image: np.ndarray) -> None:
        """Add an image."""
        pixels = image.reshape(-1, 3) / 255
        self._least.add(pixels.min(axis=0))
        self._greatest.add(pixels.max(axis=0))
        self._mean.add(pixels.mean(axis=0))
        self._square.add((pixels**2).mean(axis=0))

    def summary(self) -> dict[str, np.ndarray]:
        """min, max, mean, std, each (3, 1, 1)."""
        mean = self._mean.summary()["mean"]
        out = {
            "min": self._least.summary()["min"],
            "max": self._greatest.summary()["max"],
            "mean": mean,
            "std": np.sqrt(np.maximum(self._square.summary()["mean"] - mean**2, 0)),
        }
        return {key: value.reshape(3, 1, 1) for key, value in out.items()}
