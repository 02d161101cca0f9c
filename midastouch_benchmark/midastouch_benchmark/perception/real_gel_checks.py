"""Report `checks`, and the checks on sensors of real gel: slow changes of light that are taken for a contact, light
touches that are missed, and how reliably a gel is recognised by its texture.

One gate (`DepthStage`) decides the first two: a contact is a change that a shape explains. For the last, each sensor is
compared with its own no-contact image and with those of other sensors.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.gel_texture import GelCheck, gel_texture, likeness
from midastouch_perception.objects import bundled_objects
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, background_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet, load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.optics import ColourTable
from midastouch_simulation.randomisation import RandomisationRange
from midastouch_simulation.training.setting import load_backgrounds
from midastouch_tools.datasets.ball_presses import BallPresses, load_ball_presses
from midastouch_tools.progress import progress_bar

from ..trials.real_sensor import calibrate_measured
from .check_quality import (
    LIGHT_TOUCHES,
    TOUCHES,
    as_bytes,
    check_quality,
    diameter_checks,
    imaginary_sensors,
    layout_quality,
    missed_by_depth,
    real_checks,
    wire,
)

SLOW_LIGHT = (0.05, 0.1, 0.2, 0.4)
"""Largest change of the light within a record, as a fraction of the no-contact image."""
RECORDS = (120, 12)
"""Numbers of images of a record: the same change is spread over many, or over few."""
_NOISE = 1.5  # standard deviation of a pixel, grey levels
_LAMPS = 3


@dataclass(frozen=True)
class Reading:
    """A sensor of real gel and its depth network. Attributes: what: its name in tables; sensor: at full size; tdn;
    background: (H, W, 3) uint8, its no-contact image; optics: None if they were not measured."""

    what: str
    sensor: SensorModel
    tdn: DepthNet
    background: np.ndarray
    optics: MeasuredOptics | None = None


def measured_readings(tdn: str, rng: np.random.Generator) -> list[Reading]:
    """Return the measured sensors, each without and with a calibration; tdn: name or file of a depth network."""
    sensor, out = SensorModel.load("digit_real"), []
    for optics in map(MeasuredOptics.load, measured_sensors()):
        background = MeasuredSensor(optics, sensor, rng).background
        for what, calibration in (("DIGIT", None), ("DIGIT, calibrated", calibrate_measured(optics, sensor, rng))):
            out.append(Reading(what, sensor, load_tdn(tdn, sensor, calibration=calibration), background, optics))
    return out


def mini_reading(tdn: str) -> Reading:
    """Return a GelSight Mini read by the calibration of its model, with the no-contact colours of that calibration."""
    mini = SensorModel.load("gelsight_mini")
    return Reading("GelSight Mini, by its model's calibration", mini, load_tdn(tdn, mini), resting_image(mini))


def resting_image(sensor: SensorModel) -> np.ndarray:
    """Return the no-contact image (H, W, 3) uint8 of a sensor that has a calibration of its model, by its colours."""
    colours = SensorCalibration.default(sensor).background
    return as_bytes(cv2.resize(colours, (sensor.width, sensor.height), interpolation=cv2.INTER_CUBIC))


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
    seen: dict[str, list[tuple[float, bool]]] = {}
    meshes = {"eyebolt": ObjectMesh.load(bundled_objects()["eyebolt"]), "wire": wire()}
    for part, mesh in meshes.items():
        for reading in readings:
            poses = sample_contact_poses(mesh, n, rng, reading.sensor, LIGHT_TOUCHES)
            maps = PenetrationRenderer(mesh, reading.sensor.for_maps).render(poses)
            camera = MeasuredSensor(reading.optics, reading.sensor, rng)
            some = seen.setdefault(f"{part}; {reading.what}", [])
            for penetration, image in zip(maps, camera.images(maps), strict=True):
                contact = DepthStage(reading.tdn).process(image, camera.background)
                some.append((float(penetration.max()), contact.in_contact))
    return {what: missed_by_depth(touches) for what, touches in seen.items()}


_WINDOW = 12  # images of a verdict
_DRAWS = 40  # verdicts on each sensor with its own no-contact image
_TWICE = 2  # verdicts with each no-contact image of another sensor
_MOVED = (4, -3)  # px, rows and columns
_SPOT = 60  # px, 3 mm
_NO_RESPONSE = np.zeros((12, 6, 2))  # of a calibration: another gel is recognised without it
_BRIGHTER = 0.1  # standard deviation of the light's logarithm by colour


def gels_known(
    tdn: DepthNet,
    presses: dict[str, BallPresses],
    backgrounds: np.ndarray,
    sensor: SensorModel,
    rng: np.random.Generator,
) -> dict[str, dict[str, float]]:
    """Return by case the number of trials and the fraction of these in which the check on the gel warns.

    tdn: of the sensors' model; presses: of different sensors; backgrounds: (B, H, W, 3) uint8 of further sensors, which
    are also compared pair by pair; sensor: at full size.
    """
    said: dict[str, list[bool]] = {
        name: []
        for name in (
            "as it should be",
            "another gel's no-contact image",
            "the gel has moved",
            "a spot of 3 mm",
            "another gel's calibration",
            "its own calibration, in another light",
            "another gel's calibration, by colours alone",
            "its own calibration, in another light, by colours alone",
        )
    }
    for name, each in presses.items():
        images = list(each.images.values())
        penetrations = [tdn.predict(image, each.background) for image in images]

        def warns(background: np.ndarray, images=images, penetrations=penetrations) -> str:
            check = GelCheck(sensor, every=1, window=_WINDOW)
            for k in rng.choice(len(images), _WINDOW, replace=False):
                check.observe(images[k], background, penetrations[k])
            return check.problem

        others = [*backgrounds, *(other.background for key, other in presses.items() if key != name)]
        said["another gel's no-contact image"] += ["another gel" in warns(other) for other in _TWICE * others]
        for _ in range(_DRAWS):
            other = others[rng.integers(len(others))]
            said["as it should be"].append(bool(warns(each.background)))
            said["the gel has moved"].append("moved" in warns(np.roll(each.background, _MOVED, axis=(0, 1))))
            said["a spot of 3 mm"].append("dirty or worn" in warns(_with_spot(each.background, other, rng)))
        for calibration, how in texture_calibrations(each, penetrations, sensor):
            said["another gel's calibration" + how] += [bool(calibration.background_problem(other)) for other in others]
            said["its own calibration, in another light" + how] += [
                bool(calibration.background_problem(_in_another_light(each.background, rng))) for _ in range(_DRAWS)
            ]
    textures = [gel_texture(each) for each in backgrounds]
    said["two no-contact images taken for one gel"] = [likeness(*pair).same for pair in combinations(textures, 2)]
    return {name: {"trials": len(warned), "said": float(np.mean(warned))} for name, warned in said.items() if warned}


def texture_calibrations(
    presses: BallPresses, penetrations: list[np.ndarray], sensor: SensorModel
) -> list[tuple[SensorCalibration, str]]:
    """Return calibrations with all by which `midastouch calibrate` recognises a gel, and without its texture."""
    pairs = zip(presses.images.values(), penetrations, strict=True)
    # wider than the textures: their sums would wrap in int8
    seen = np.sum([gel_texture(image, penetration > 0) for image, penetration in pairs], axis=0, dtype=np.int64)
    texture = gel_texture(presses.background)
    calibration = SensorCalibration(
        serial="",
        ball_diameter=1.0,
        sensor=sensor.name,
        pixel_size=sensor.pixel_size,
        coefficients=_NO_RESPONSE,
        background=background_colours(presses.background),
        presses=len(presses.images),
        date="",
        texture=texture,
        texture_sigmas=likeness(texture, seen).sigmas,  # type: ignore[arg-type] # there are presses
    )
    return [(calibration, ""), (dataclasses.replace(calibration, texture_sigmas=0.0), ", by colours alone")]


def _in_another_light(background: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return another no-contact image of the same gel: each lamp brighter or darker, with fresh noise."""
    light = np.exp(_BRIGHTER * rng.standard_normal(3))
    return as_bytes(background * light + rng.normal(0, _NOISE, background.shape))


def _with_spot(background: np.ndarray, other: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a no-contact image with the grains of another one in a square."""
    row, column = (rng.integers(_SPOT // 2, size - 1.5 * _SPOT) for size in background.shape[:2])
    square = slice(row, row + _SPOT), slice(column, column + _SPOT)
    light = [cv2.GaussianBlur(each.astype(np.float32), (0, 0), 4) for each in (background, other)]
    spoiled = background.copy()
    spoiled[square] = np.clip(light[0] + other - light[1], 0, 255)[square]
    return spoiled


_RECORDS = 12  # of slow light on each calibrated sensor


def report(args: argparse.Namespace) -> dict:
    """Measure how often the checks on tactile images are wrong, on imaginary, measured and real sensors."""
    sensor, rng = SensorModel.load(args.sensor), np.random.default_rng(args.seed)
    pressed = {Path(folder).name: load_ball_presses(folder) for folder in args.presses}
    backgrounds = np.concatenate(load_backgrounds(args.backgrounds, sensor.height, sensor.width))
    ranges = RandomisationRange(colour_table=ColourTable.load(args.colour_table) if args.colour_table else None)
    network = load_tdn(args.tdn, sensor)
    sensors = pairwise(imaginary_sensors(args.sensors + 1, sensor, backgrounds, ranges, rng))
    quality = check_quality(network, progress_bar(iterable=sensors, total=args.sensors, unit="sensor"))
    real = SensorModel.load("digit_real")
    network_of_real = load_tdn(args.tdn, real)
    large = np.concatenate(load_backgrounds(args.backgrounds, real.height, real.width))
    digits = [Reading("DIGIT", real, network_of_real, background) for background in large]
    measured = measured_readings(args.tdn, rng)
    calibrated = [each for each in measured if each.tdn.calibration_in_use] + [mini_reading(args.tdn)]
    refused, named = layout_quality(backgrounds)
    return {
        "network": network.network_id,
        "sensor": args.sensor,
        "sensors": args.sensors,
        "no_contact_images": len(backgrounds),
        "seed": args.seed,
        **quality,
        "no_contact_image": refused,
        "cause_named": named,
        "light_touches": missed_touches(measured, TOUCHES * args.sensors, rng),
        "real_sensors": {name: real_checks(network_of_real, each, rng) for name, each in pressed.items()},
        "gels": gels_known(network_of_real, pressed, large, real, rng),
        "slow_light": slow_light(digits, 1, rng) + slow_light(calibrated, _RECORDS, rng),
        "ball_diameter": diameter_checks(real, large, args.sensors, rng),
    }
