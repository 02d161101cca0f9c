"""Presses of a ball on a simulated sensor, for calibrations whose truth is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..sensor_calibration.ball import ball_centre, ball_penetration
from ..sensor_model import SensorModel
from .randomisation import RandomSensor

_LARGEST = 2.0e-3  # m, radius of a contact: a hard press
_COLUMNS, _ROWS = (0.29, 0.5, 0.71), (0.22, 0.41, 0.59, 0.78)  # of the image, where presses are


class PressedSensor:
    """A simulated sensor, of the randomisation that networks are trained with, under a ball of `radius` m.

    Args: sensor, full size; backgrounds (B, H, W, 3) uint8 RGB, no-contact images to choose from; radius; rng.
    Attribute: background (H, W, 3) uint8 RGB, its no-contact image.
    """

    def __init__(self, sensor: SensorModel, backgrounds: np.ndarray, radius: float, rng: np.random.Generator):
        self.sensor, self._radius, self._rng = sensor, radius, rng
        self._light = RandomSensor(sensor, backgrounds, rng)
        self.background = self.image([])

    def image(self, contacts: Sequence[tuple[float, float, float]]) -> np.ndarray:
        """Image (H, W, 3) uint8 RGB with the ball at columns and rows [px], touching in circles of so many m."""
        return self.image_of(self.penetration(contacts))

    def penetration(self, contacts: Sequence[tuple[float, float, float]]) -> np.ndarray:
        """Penetration (H, W) float32 m of the same."""
        caps = [np.zeros((self.sensor.height, self.sensor.width), np.float32)]
        for u, v, contact in contacts:
            centre = ball_centre(u, v, contact, self._radius, self.sensor)
            caps.append(ball_penetration(centre, self._radius, self.sensor))
        return np.max(caps, axis=0)

    def image_of(self, penetration: np.ndarray) -> np.ndarray:
        """Image (H, W, 3) uint8 RGB of a penetration (H, W) float32 m."""
        images, _ = self._light.images(penetration[None], np.zeros((1, *penetration.shape, 3), np.float32), self._rng)
        return np.clip(images[0], 0, 255).astype(np.uint8)

    def presses(self, n: int) -> dict[str, np.ndarray]:
        """Images by file name of n presses, at most twelve, spread over the gel and of different depth."""
        places = [(u * self.sensor.width, v * self.sensor.height) for v in _ROWS for u in _COLUMNS]
        chosen = sorted(self._rng.permutation(len(places))[:n])
        widest = min(_LARGEST, 0.6 * self._radius)
        contacts = self._rng.uniform(0.6 * widest, widest, n)
        return {f"{i}.png": self.image([(*places[i], c)]) for i, c in zip(chosen, contacts, strict=True)}
