"""An endless, seeded stream of simulated touches for training."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ..mesh import ObjectMesh
from ..sensor_model import SensorModel
from ..simulation.contact_poses import ContactSampling, sample_contact_poses
from ..simulation.randomisation import RandomisationRange, RandomSensor
from ..simulation.renderer import PenetrationRenderer

_POSES_PER_OBJECT = 96
_SENSORS_PER_OBJECT = 8
# wider than the paper's: small presses too, or light touches are missed
_SAMPLING = ContactSampling(press=(0.2e-3, 2e-3), free_share=0.04)


@dataclasses.dataclass(frozen=True)
class Touch:
    """One simulated touch at the nets' resolution.

    Attributes: difference (H, W, 3) float32, image minus reference no-contact image, grey levels; penetration
    (H, W) float32 m; sensor, the geometry it was rendered with.
    """

    difference: np.ndarray
    penetration: np.ndarray
    sensor: SensorModel


def touches(
    meshes: list[ObjectMesh],
    sensors: list[SensorModel],
    backgrounds: np.ndarray,
    rng: np.random.Generator,
    ranges: RandomisationRange,
) -> Iterator[Touch]:
    """Touches on random objects with random DIGITs; 96 an object, 12 a DIGIT, in that order (shuffle them)."""
    renderers: dict[tuple[int, int], PenetrationRenderer] = {}
    while True:
        which = int(rng.integers(len(meshes))), int(rng.integers(len(sensors)))
        if which not in renderers:
            renderers[which] = PenetrationRenderer(meshes[which[0]], sensors[which[1]])
        renderer, sensor = renderers[which], sensors[which[1]]
        poses = sample_contact_poses(meshes[which[0]], _POSES_PER_OBJECT, rng, sensor, _SAMPLING)
        penetration, normals = renderer.render_with_normals(poses)
        for part in np.array_split(np.arange(len(poses)), _SENSORS_PER_OBJECT):
            imaginary = RandomSensor(sensor, backgrounds, rng, ranges)
            images, reference = imaginary.images(penetration[part], normals[part], rng)
            for image, depth in zip(images, penetration[part], strict=True):
                yield Touch(image - reference, depth, sensor)


def shuffled(stream: Iterator[Touch], size: int, rng: np.random.Generator) -> Iterator[Touch]:
    """The stream in random order, through a reservoir of `size` touches."""
    reservoir = [next(stream) for _ in range(size)]
    while True:
        slot = int(rng.integers(size))
        yield reservoir[slot]
        reservoir[slot] = next(stream)
