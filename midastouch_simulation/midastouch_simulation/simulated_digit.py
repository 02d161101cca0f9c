"""Imaginary sensors with the renderer and the optics of the training: touching an object, or pressed by a ball."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.contact import Contact
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel

from .randomisation import RandomisationRange, RandomSensor

# In a stream, no region of the image may lose a light for only one frame.
_STEADY_LIGHT = RandomisationRange(dark_fraction=0.0)
_WIDEST_CONTACT = 2.0e-3  # m, radius of a contact: a hard press
_COLUMNS, _ROWS = (0.29, 0.5, 0.71), (0.22, 0.41, 0.59, 0.78)  # of the image, where presses are


@dataclasses.dataclass(frozen=True)
class SimulatedFrame:
    """One frame. Attributes: image (H, W, 3) uint8 RGB; truth, the contact that it shows, at the resolution of
    penetration maps; deepest [m], largest penetration of the object."""

    image: np.ndarray
    truth: Contact
    deepest: float


class SimulatedCamera:
    """Sensor whose light, gel, shadows and noise are drawn by `rng`, as `RandomSensor` draws them for training.

    Args: sensor, at the resolution of the image; background (H, W, 3) uint8 RGB, its no-contact image, which is also an
    attribute.
    """

    def __init__(self, sensor: SensorModel, background: np.ndarray, rng: np.random.Generator):
        self.background = background
        self._sensor = RandomSensor(sensor, background[None], rng, _STEADY_LIGHT)
        self._sensor.background = background.astype(np.float32)

    def image(self, penetration: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the image (H, W, 3) uint8 RGB of a penetration map (H, W) m with its surface normals (H, W, 3)."""
        return np.rint(self._sensor.image(penetration, normals, rng)).astype(np.uint8)


class SimulatedDigit:
    """`SimulatedCamera` that touches an object.

    Parameters
    ----------
    mesh
        The object.
    sensor, background
        As for `SimulatedCamera`.
    seed
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, background: np.ndarray, seed: int):
        self._rng = np.random.default_rng(seed)
        self._sensor = sensor
        self._renderer = PenetrationRenderer(mesh, sensor)
        self._camera = SimulatedCamera(sensor, background, self._rng)

    def look(self, T_obj_gel: np.ndarray) -> SimulatedFrame:
        """Take one frame.

        Parameters
        ----------
        T_obj_gel : pose (4, 4) of the gel
        """
        (penetration,), (normals,) = self._renderer.render_with_normals(T_obj_gel[None])
        image = self._camera.image(penetration, normals, self._rng)
        small = self._sensor.for_maps
        # the mean, because two by two pixels of the image are one of the map
        mean = cv2.resize(penetration, (small.width, small.height), interpolation=cv2.INTER_AREA)
        return SimulatedFrame(image, Contact.of(mean, small), float(penetration.max()))


class PressedSensor:
    """Simulated sensor, of the randomisation that networks are trained with, pressed by a ball of `radius` m.

    Args: sensor, full size; backgrounds (B, H, W, 3) uint8 RGB, no-contact images to choose from; radius; rng.
    Attribute: background (H, W, 3) uint8 RGB, its no-contact image.
    """

    def __init__(self, sensor: SensorModel, backgrounds: np.ndarray, radius: float, rng: np.random.Generator):
        self.sensor, self._radius, self._rng = sensor, radius, rng
        self._light = RandomSensor(sensor, backgrounds, rng)
        self.background = self.image([])

    def image(self, contacts: Sequence[tuple[float, float, float]]) -> np.ndarray:
        """Return the image (H, W, 3) uint8 RGB of contacts with the ball: column [px], row [px], contact radius [m]."""
        return self.image_of(self.penetration(contacts))

    def penetration(self, contacts: Sequence[tuple[float, float, float]]) -> np.ndarray:
        """Return the penetration (H, W) float32 m of the same contacts."""
        caps = [np.zeros((self.sensor.height, self.sensor.width), np.float32)]
        for u, v, contact in contacts:
            centre = ball_centre(u, v, contact, self._radius, self.sensor)
            caps.append(ball_penetration(centre, self._radius, self.sensor))
        return np.max(caps, axis=0)

    def image_of(self, penetration: np.ndarray) -> np.ndarray:
        """Return the image (H, W, 3) uint8 RGB of a penetration (H, W) float32 m."""
        images, _ = self._light.images(penetration[None], np.zeros((1, *penetration.shape, 3), np.float32), self._rng)
        return np.clip(images[0], 0, 255).astype(np.uint8)

    def presses(self, n: int) -> dict[str, np.ndarray]:
        """Return images by file name of n presses, at most twelve, spread over the gel and of different depth."""
        positions = [(u * self.sensor.width, v * self.sensor.height) for v in _ROWS for u in _COLUMNS]
        chosen = sorted(self._rng.permutation(len(positions))[:n])
        widest = min(_WIDEST_CONTACT, 0.6 * self._radius)
        contacts = self._rng.uniform(0.6 * widest, widest, n)
        places = [(*positions[i], contact) for i, contact in zip(chosen, contacts, strict=True)]
        return {f"{number:02d}.png": self.image([place]) for number, place in enumerate(places, 1)}
