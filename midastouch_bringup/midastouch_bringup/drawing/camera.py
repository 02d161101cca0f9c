"""Orthographic cameras around an object."""

from __future__ import annotations

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Camera:
    """Looks at `centre` (3,) m of the object frame; pixels are square, `pixel_size` m each.

    rotation (3, 3): rows are the picture's right, up and towards-viewer directions in the object frame.
    """

    rotation: np.ndarray
    centre: np.ndarray
    pixel_size: float
    width: int
    height: int

    @classmethod
    def around(cls, points: np.ndarray, towards_viewer: np.ndarray, up: np.ndarray, width: int, height: int) -> Camera:
        """The camera on the side `towards_viewer` (3,) that shows all points (N, 3) with a 6 % margin."""
        z = np.asarray(towards_viewer, float) / np.linalg.norm(towards_viewer)
        x = np.cross(up, z)
        if np.linalg.norm(x) < 1e-3:  # looking along `up`: any other direction serves
            x = np.cross(np.roll(up, 1), z)
        x /= np.linalg.norm(x)
        rotation = np.stack([x, np.cross(z, x), z])
        seen = points @ rotation.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        spread = high - low
        pixel_size = 1.06 * max(spread[0] / width, spread[1] / height)
        return cls(rotation, rotation.T @ ((low + high) / 2), float(pixel_size), width, height)

    def scaled(self, factor: int) -> Camera:
        """The same picture with `factor` times as many pixels along each side."""
        return dataclasses.replace(
            self,
            pixel_size=self.pixel_size / factor,
            width=self.width * factor,
            height=self.height * factor,
        )

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixel positions (..., 2) and heights towards the viewer (...) m of points (..., 3) m."""
        seen = (np.asarray(points, float) - self.centre) @ self.rotation.T
        column = seen[..., 0] / self.pixel_size + self.width / 2
        row = -seen[..., 1] / self.pixel_size + self.height / 2
        return np.stack([column, row], axis=-1), seen[..., 2]

    def unproject(self, columns: np.ndarray, rows: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Points (..., 3) m of the object frame behind pixel positions at heights (...) m towards the
        viewer."""
        x = (columns - self.width / 2) * self.pixel_size
        y = -(rows - self.height / 2) * self.pixel_size
        return np.stack([x, y, heights], axis=-1) @ self.rotation + self.centre


def best_direction(normals: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Direction (3,) from which surface with normals (N, 3) is seen most squarely, a little from above."""
    n = 200
    k = np.arange(n) + 0.5
    z, azimuth = 1 - 2 * k / n, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - z**2)
    directions = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)
    # square root: two sides seen at a slant are worth more than one seen squarely
    facing = np.sqrt(np.maximum(directions @ np.asarray(normals).T, 0.0))
    score = facing @ (np.ones(len(normals)) if weights is None else weights) / len(normals)
    steep = np.abs(directions[:, 2])
    return directions[int(np.argmax(score - 0.3 * np.maximum(steep - 0.7, 0) + 0.05 * directions[:, 2]))]
