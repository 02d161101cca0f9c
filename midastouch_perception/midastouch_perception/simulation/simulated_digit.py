"""One imaginary sensor that looks at an object, frame after frame: renderer and optics of the training."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from midastouch_common.mesh import ObjectMesh

from ..contact import Contact
from ..rendering.renderer import PenetrationRenderer
from ..sensor_model import SensorModel
from .randomisation import RandomisationRange, RandomSensor

# No region of the image is to lose a light for one frame: those of a stream belong together.
_STEADY = RandomisationRange(dark_share=0.0)


@dataclasses.dataclass(frozen=True)
class SimulatedFrame:
    """Attributes: image (H, W, 3) uint8 RGB; truth, the contact that it shows, at the resolution of penetration maps;
    deepest [m], how far the object is in the gel."""

    image: np.ndarray
    truth: Contact
    deepest: float


class SimulatedCamera:
    """A sensor whose light, gel, shadows and noise are drawn by `rng`, as `RandomSensor` draws them for training.

    Args: sensor, at the resolution of the image; background (H, W, 3) uint8 RGB, what it sees without contact, as an
    attribute too.
    """

    def __init__(self, sensor: SensorModel, background: np.ndarray, rng: np.random.Generator):
        self.background = background
        self._sensor = RandomSensor(sensor, background[None], rng, _STEADY)
        self._sensor.background = background.astype(np.float32)

    def image(self, penetration: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Image (H, W, 3) uint8 RGB of a penetration map (H, W) m with its surface normals (H, W, 3)."""
        return np.rint(self._sensor.image(penetration, normals, rng)).astype(np.uint8)


class SimulatedDigit:
    """A `SimulatedCamera`, drawn by `seed`, over an object; the arguments are its own and the object's mesh."""

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, background: np.ndarray, seed: int):
        self._rng = np.random.default_rng(seed)
        self._sensor = sensor
        self._renderer = PenetrationRenderer(mesh, sensor)
        self._camera = SimulatedCamera(sensor, background, self._rng)

    def look(self, T_obj_gel: np.ndarray) -> SimulatedFrame:
        """What it sees with its gel at T_obj_gel (4, 4)."""
        (penetration,), (normals,) = self._renderer.render_with_normals(T_obj_gel[None])
        image = self._camera.image(penetration, normals, self._rng)
        small = self._sensor.for_maps
        # the mean: two by two pixels of the image are one of the map
        mean = cv2.resize(penetration, (small.width, small.height), interpolation=cv2.INTER_AREA)
        return SimulatedFrame(image, Contact.of(mean, small), float(penetration.max()))
