"""One imaginary DIGIT that looks at an object, frame after frame: renderer and optics of the training."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from ..contact import Contact
from ..mesh import ObjectMesh
from ..sensor_model import SensorModel
from .randomisation import RandomisationRange, RandomSensor
from .renderer import PenetrationRenderer

# No region of the image is to lose a light for one frame: those of a stream belong together.
_STEADY = RandomisationRange(dark_share=0.0)


@dataclasses.dataclass(frozen=True)
class SimulatedFrame:
    """Attributes: image (H, W, 3) uint8 RGB; truth, the contact that it shows, at the resolution of penetration maps;
    deepest [m], how far the object is in the gel."""

    image: np.ndarray
    truth: Contact
    deepest: float


class SimulatedDigit:
    """A sensor whose light, gel, shadows and noise are drawn by `seed`, as `RandomSensor` draws them for training.

    Args: mesh, of the object; sensor, at the resolution of the image; background (H, W, 3) uint8 RGB, what it sees
    without contact.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, background: np.ndarray, seed: int):
        self._rng = np.random.default_rng(seed)
        self._sensor = sensor
        self._renderer = PenetrationRenderer(mesh, sensor)
        self._camera = RandomSensor(sensor, background[None], self._rng, _STEADY)
        self._camera.background = background.astype(np.float32)

    def look(self, T_obj_gel: np.ndarray) -> SimulatedFrame:
        """What it sees with its gel at T_obj_gel (4, 4)."""
        (penetration,), (normals,) = self._renderer.render_with_normals(T_obj_gel[None])
        image = self._camera.image(penetration, normals, self._rng)
        small = self._sensor.for_maps
        # the mean: two by two pixels of the image are one of the map
        mean = cv2.resize(penetration, (small.width, small.height), interpolation=cv2.INTER_AREA)
        return SimulatedFrame(np.rint(image).astype(np.uint8), Contact.of(mean, small), float(penetration.max()))
