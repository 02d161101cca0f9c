"""Slow changes of light that sensors of real gel take for a contact, and light touches that they miss.

The same gate (`DepthStage`) decides both: a contact is a change that a shape explains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet, load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors

from ..trials.real_sensor import calibrate_measured
from .check_quality import LIGHT_TOUCHES, as_bytes, missed_by_depth, wire

SLOW_LIGHT = (0.05, 0.1, 0.2, 0.4)
"""Largest change of the light within a record, as a fraction of the no-contact image."""
RECORDS = (120, 12)
"""Numbers of images of a record: the same change is spread over many, or over few."""
_NOISE = 1.5  # grey levels
_LAMPS = 3


@dataclass(frozen=True)
class Reading:
    """A sensor of real gel and its depth network. Attributes: what: its name in tables; tdn; background: (H, W, 3)
    uint8, its no-contact image; optics: None if they were not measured."""

    what: str
    tdn: DepthNet
    background: np.ndarray
    optics: MeasuredOptics | None = None


def measured_readings(tdn: str, rng: np.random.Generator) -> list[Reading]:
    """Return the measured sensors, each without and with a calibration; tdn: name or file of a depth network."""
    sensor, out = SensorModel.load("digit_real"), []
    for optics in map(MeasuredOptics.load, measured_sensors()):
        background = MeasuredSensor(optics, sensor, rng).background
        for what, calibration in (("DIGIT", None), ("DIGIT, calibrated", calibrate_measured(optics, sensor, rng))):
            out.append(Reading(what, load_tdn(tdn, sensor, calibration=calibration), background, optics))
    return out


def mini_reading(tdn: str) -> Reading:
    """Return a GelSight Mini read by the calibration of its model, with the no-contact colours of that calibration."""
    mini = SensorModel.load("gelsight_mini")
    colours = SensorCalibration.default(mini).background
    background = cv2.resize(colours, (mini.width, mini.height), interpolation=cv2.INTER_CUBIC)
    return Reading("GelSight Mini, by its model's calibration", load_tdn(tdn, mini), as_bytes(background))


def slow_light(readings: Sequence[Reading], records: int, rng: np.random.Generator) -> list[dict]:
    """Return, by reading, `RECORDS` and `SLOW_LIGHT`, frames without contact and the fraction taken for a contact.

    Readings of the same name count together; records: number of each reading. The light of lamps, a broad lobe of each
    colour, changes linearly with time.
    """
    seen: dict[tuple[str, int, float], list[bool]] = {}
    for reading in readings:
        for frames in RECORDS:
            for most in SLOW_LIGHT:
                some = seen.setdefault((reading.what, frames, most), [])
                for _ in range(records):
                    stage, background = DepthStage(reading.tdn), reading.background
                    lobes = most * rng.choice([-1, 1], _LAMPS) * _lobes(background.shape, rng)
                    for time in np.linspace(0, 1, frames):
                        image = background * (1 + time * lobes) + rng.normal(0, _NOISE, background.shape)
                        some.append(stage.process(as_bytes(image), background).in_contact)
    return [
        {
            "sensor": what,
            "images": images,
            "change": change,
            "frames": len(some),
            "false_contacts": float(np.mean(some)),
        }
        for (what, images, change), some in seen.items()
    ]


def _lobes(shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Return the light (H, W, 3) of lamps centred anywhere on an image (H, W, ...), 1 at the centre of each."""
    rows, columns = np.mgrid[-1 : 1 : shape[0] * 1j, -1 : 1 : shape[1] * 1j]
    lobes = [np.exp(-((columns - x) ** 2) - (rows - y) ** 2) for x, y in rng.uniform(-1, 1, (_LAMPS, 2))]
    return np.stack(lobes, axis=-1)


def missed_touches(readings: Sequence[Reading], n: int, rng: np.random.Generator) -> dict[str, list[dict]]:
    """Return `missed_by_depth`, by object and reading, of `n` light touches of an eyebolt and of a wire on each
    measured sensor."""
    sensor = SensorModel.load("digit_real")
    seen: dict[str, list[tuple[float, bool]]] = {}
    meshes = {"eyebolt": ObjectMesh.load(bundled_objects()["eyebolt"]), "wire": wire()}
    for part, mesh in meshes.items():
        renderer = PenetrationRenderer(mesh, sensor.for_maps)
        for reading in readings:
            poses = sample_contact_poses(mesh, n, rng, sensor, LIGHT_TOUCHES)
            seen.setdefault(f"{part}; {reading.what}", []).extend(
                _touches(reading, renderer.render(poses), sensor, rng)
            )
    return {what: missed_by_depth(touches) for what, touches in seen.items()}


def _touches(
    reading: Reading, maps: np.ndarray, sensor: SensorModel, rng: np.random.Generator
) -> Iterator[tuple[float, bool]]:
    """Yield the deepest penetration [m] of each of the maps (N, H, W) m, and whether a contact is seen."""
    camera = MeasuredSensor(reading.optics, sensor, rng)
    for penetration, image in zip(maps, camera.images(maps), strict=True):
        stage = DepthStage(reading.tdn)
        yield float(penetration.max()), stage.process(image, camera.background).in_contact
