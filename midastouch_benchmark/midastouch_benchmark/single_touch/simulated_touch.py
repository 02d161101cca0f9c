"""Simulated touches as the networks perceive them, every few through another imaginary DIGIT.

They are rendered at the depth network's resolution, like its training data. For TACTO's optics the mean of four pixels
of the full image and the image of the reduced map differ by 0.2 grey levels RMS, and their codes have a cosine of
0.9998; the reduced map is four times as fast.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.contact import ContactDetector
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import AnyCodeNet
from midastouch_perception.tdn.fcrn import FcrnDepthNet
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.optics import TactoOptics
from midastouch_simulation.randomisation import RandomSensor
from midastouch_simulation.training.setting import load_backgrounds

from ..trials.setup import Networks

_TOUCHES_PER_SENSOR = 20
_PIXEL_NOISE = 1.0  # grey levels: the camera's 2 of TACTO, averaged over four pixels
_LEAST_IN_CONTACT = 0.05


@dataclasses.dataclass(frozen=True)
class Lighting:
    """Light of the imaginary sensors.

    Attributes: kind: `tacto` (TACTO's optics, another no-contact image for each sensor) or `random` (the domain
    randomisation of the training); backgrounds: (B, 160, 120, 3) uint8, no-contact images, or None to invent them.
    """

    kind: str = "tacto"
    backgrounds: np.ndarray | None = None

    @classmethod
    def load(cls, kind: str, folder: str | Path | None, sensor: SensorModel) -> Lighting:
        """Load the images of `folder` that no training uses as backgrounds; InputError if there are too few in it."""
        small = sensor.for_maps
        return cls(kind, load_backgrounds(folder, small.height, small.width)[1] if folder else None)

    def draw_background(self, sensor: SensorModel, rng: np.random.Generator) -> np.ndarray:
        """Draw a no-contact image (160, 120, 3) uint8 RGB."""
        if self.backgrounds is None:
            return no_contact_image(sensor, rng)
        return self.backgrounds[rng.integers(len(self.backgrounds))]


@dataclasses.dataclass(frozen=True)
class Percepts:
    """Results of the first stage for N touches.

    Attributes: penetration: (N, 160, 120) float32 m, 0 where nothing is touched; in_contact: (N,) bool, whether it
    passes for a contact; truth: (N, 160, 120) float32 m, the true penetration.
    """

    penetration: np.ndarray
    in_contact: np.ndarray
    truth: np.ndarray


class TouchSimulator:
    """Simulator of touches on one object by imaginary sensors."""

    def __init__(self, mesh: ObjectMesh, networks: Networks, lighting: Lighting):
        self.mesh = mesh
        self._tdn, self._lighting = networks.tdn, lighting
        self._sensor = networks.sensor.for_maps
        self._renderer = PenetrationRenderer(mesh, self._sensor)
        self._tacto = TactoOptics(self._sensor)

    def percepts(self, poses: np.ndarray, rng: np.random.Generator) -> Iterator[Percepts]:
        """Yield the touches at gel poses `T_obj_gel` (N, 4, 4) in their order, those of one sensor at a time."""
        for start in range(0, len(poses), _TOUCHES_PER_SENSOR):
            penetration, normals = self._renderer.render_with_normals(poses[start : start + _TOUCHES_PER_SENSOR])
            images, background = self._images(penetration, normals, rng)
            difference = images - background
            seen = self._see(difference, images)
            # a new detector for each touch: no earlier touch may help to detect it
            contacts = [ContactDetector(self._sensor).update(one) for one in seen]
            in_contact = np.array([contact.in_contact for contact in contacts])
            measured = np.stack([contact.penetration for contact in contacts])
            yield Percepts(measured, in_contact, penetration)

    def _images(
        self, penetration: np.ndarray, normals: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return images (N, 160, 120, 3) of one sensor and its no-contact image (160, 120, 3); float32 grey levels."""
        background = self._lighting.draw_background(self._sensor, rng)
        if self._lighting.kind == "random":
            return RandomSensor(self._sensor, background[None], rng).images(penetration, normals, rng)
        images = [
            self._tacto.image(depth, background, rng, surface, _PIXEL_NOISE)
            for depth, surface in zip(penetration, normals, strict=True)
        ]
        return np.stack(images).astype(np.float32), background.astype(np.float32)

    def _see(self, difference: np.ndarray, images: np.ndarray) -> np.ndarray:
        """Return the penetration (N, 160, 120) float32 m that the depth network predicts."""
        if not isinstance(self._tdn, FcrnDepthNet):
            return self._tdn.penetration(difference)  # type: ignore[attr-defined] # of our own networks
        # FCRN takes whole camera images, and no background
        whole = np.clip(np.rint(images), 0, 255).astype(np.uint8).repeat(2, axis=1).repeat(2, axis=2)
        return np.stack([self._tdn.predict(image, image) for image in whole])

    def encode(
        self,
        poses: np.ndarray,
        tcn: AnyCodeNet,
        rng: np.random.Generator,
        progress: Callable[[int], object] = lambda touches: None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the codes (N, D) of the touches at `poses` (N, 4, 4), and which (N,) pass for a contact.

        A touch that does not gets a random code, as in the paper (appendix C). Raises InputError if hardly any does.
        """
        codes, touching = [], []
        for percepts in self.percepts(poses, rng):
            touching.append(percepts.in_contact)
            encoded = tcn.encode(percepts.penetration)
            missed = np.flatnonzero(~percepts.in_contact)
            random = rng.standard_normal((len(missed), encoded.shape[1]))
            encoded[missed] = random / np.linalg.norm(random, axis=1, keepdims=True)
            codes.append(encoded)
            progress(len(percepts.in_contact))
        in_contact = np.concatenate(touching)
        if in_contact.mean() < _LEAST_IN_CONTACT:
            raise InputError(
                f"{self.mesh.name}: {in_contact.sum()} of {len(in_contact)} touches pass for a contact; "
                "does the mesh fit the sensor?"
            )
        return np.concatenate(codes), in_contact
