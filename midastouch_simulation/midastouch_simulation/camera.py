"""Cameras of an invented DIGIT: its no-contact image, and images by the light that its sensor model has."""

from __future__ import annotations

import numpy as np

from midastouch_perception.sensor_model import SensorModel

from .optics import TactoOptics
from .simulated_digit import SimulatedCamera


def no_contact_image(sensor: SensorModel, rng: np.random.Generator) -> np.ndarray:
    """Draw an image of the untouched gel of an invented DIGIT.

    As on real sensors, a grey gel darkens towards its borders and is lit red from the left, green from the right and
    blue from below; each LED differs a little.

    Parameters
    ----------
    sensor, rng

    Returns
    -------
    (H, W, 3) uint8 RGB
    """
    y, x = np.mgrid[1 : -1 : sensor.height * 1j, -1 : 1 : sensor.width * 1j]
    grey = rng.uniform(85, 115) * (1 - 0.3 * (x**2 + y**2) / 2)
    image = np.repeat(grey[..., None], 3, axis=2)
    for channel, (centre_x, centre_y) in enumerate(((-0.7, 0.15), (0.75, 0.0), (0.0, -0.9))):
        shift_x, shift_y = rng.normal(0, 0.12, 2)
        spread = rng.uniform(0.35, 0.6)
        lobe = np.exp(-((x - centre_x - shift_x) ** 2 + (0.6 * (y - centre_y - shift_y)) ** 2) / spread)
        image[..., channel] += rng.uniform(30, 60) * lobe
        image -= rng.uniform(5, 15) * lobe[..., None]
    return np.clip(image, 0, 255).astype(np.uint8)


class TactoCamera:
    """A DIGIT with the optics of TACTO; `background` (H, W, 3) uint8 RGB is its no-contact image."""

    def __init__(self, sensor: SensorModel, rng: np.random.Generator):
        self.background = no_contact_image(sensor, rng)
        self._optics = TactoOptics(sensor)

    def image(self, penetration: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the image (H, W, 3) uint8 RGB of a penetration map (H, W) m with its surface normals (H, W, 3)."""
        return self._optics.image(penetration, self.background, rng, normals)


def camera_of(sensor: SensorModel, rng: np.random.Generator) -> TactoCamera | SimulatedCamera:
    """Return the camera of a sensor by its model's light: added to the no-contact image, or relative to it."""
    if sensor.light == "additive":
        return TactoCamera(sensor, rng)
    return SimulatedCamera(sensor, no_contact_image(sensor, rng), rng)
