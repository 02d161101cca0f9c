"""Presses that grow and shrink as fast as an arm moves: is each image felt, and does the read depth never fall?"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator

import numpy as np
import trimesh

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.contact import Contact, ContactState
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.sensor_model import DIGIT_LAMPS, SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.simulated_digit import SimulatedDigit
from midastouch_tools.progress import progress_bar

from .real_gel_checks import Reading, resting_image

RATES = (30, 60)  # images a second
_SPEED = 3e-3  # m/s into the object and back
_DEPTHS = (0.2e-3, 2.5e-3)  # m
_AWAY = 5e-3  # m above the object
_FREE = 5  # images before a press, and after
_NOISE = 0.05e-3  # m by which a reading may fall
_MOST_TILT = np.radians(3.0)
_TURNED = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
_ON_EDGE = trimesh.transformations.rotation_matrix(np.pi / 4, [0, 1, 0])


def shapes() -> dict[str, tuple[ObjectMesh, float]]:
    """Return what is pressed, each with the height [m] of its highest point, by name."""
    edge = trimesh.creation.box((0.03, 0.03, 0.03))
    edge.apply_transform(_ON_EDGE)
    tube = trimesh.creation.cylinder(0.035, 0.2, sections=256)
    tube.apply_transform(_TURNED)
    solids = {
        "flat face": trimesh.creation.box((0.12, 0.12, 0.04)),
        "cylinder of 70 mm": tube,
        "ball of 6 mm": trimesh.creation.icosphere(5, 0.003),
        "edge": edge,
    }
    return {
        name: (ObjectMesh.from_arrays(solid.vertices, solid.faces, name), float(solid.bounds[1, 2]))
        for name, solid in solids.items()
    }


def pressed_sensors(tdn: str) -> list[Reading]:
    """Return a DIGIT, and a GelSight Mini with the calibration of its kind and without any, in the light of a real
    sensor of their kind; tdn: name or file of a depth network."""
    digit, mini = SensorModel.load("digit_real"), SensorModel.load("gelsight_mini")
    optics = MeasuredOptics.load(measured_sensors()[0])
    of_digit = MeasuredSensor(optics, digit, np.random.default_rng(0)).background
    of_mini = resting_image(mini)
    unknown = load_tdn(tdn, dataclasses.replace(mini, lamps=""))
    return [
        Reading(DIGIT_LAMPS, digit, load_tdn(tdn, digit), of_digit),
        Reading(mini.lamps, mini, load_tdn(tdn, mini), of_mini),
        Reading(f"{mini.lamps}, of unknown lamps", mini, unknown, of_mini),
    ]


def measured_ramps(pressed: Reading, presses: int, seed: int) -> Iterator[dict]:
    """Yield a row for each shape: the presses, their images, those that were missed, and falls of the read depth.

    A press grows and shrinks, straight or tilted by up to three degrees, at each rate in turn. missed are the images
    that are taken for free gel, presses_missed the presses with one; unknown, images that are taken neither for this
    nor for a contact. presses_falling are those whose depth falls by more than noise while they grow, apart from
    unknown images, at most by most_fall_mm; saturated, images whose depth is said to be more than the gel shows; false,
    free images before and after a press that are not free.
    """
    for shape, (mesh, top) in shapes().items():
        readings = [_read(pressed, mesh, top, number, seed) for number in range(presses)]
        touching, free = [up + down for _, up, down in readings], [each for away, _, _ in readings for each in away]
        lost = [_count(press, ContactState.FREE) for press in touching]
        known = [[each.depth_m for each in up if each.state != ContactState.UNKNOWN] for _, up, _ in readings]
        falls = np.array([-min(np.diff(depths), default=0.0) for depths in known])
        yield {
            "sensor": pressed.what,
            "shape": shape,
            "presses": presses,
            "images": sum(map(len, touching)),
            "missed": sum(lost),
            "presses_missed": int(np.count_nonzero(lost)),
            "presses_falling": int((falls > _NOISE).sum()),
            "most_fall_mm": 1e3 * float(max(falls.max(), 0)),
            "saturated": sum(_count(press, ContactState.SATURATED) for press in touching),
            "unknown": sum(_count(press, ContactState.UNKNOWN) for press in touching),
            "free_images": len(free),
            "false": len(free) - _count(free, ContactState.FREE),
        }


def _count(contacts: list[Contact], state: ContactState) -> int:
    return sum(each.state == state for each in contacts)


def _read(
    pressed: Reading, mesh: ObjectMesh, top: float, number: int, seed: int
) -> tuple[list[Contact], list[Contact], list[Contact]]:
    """Return what is felt of one press: free, as it grows, and as it shrinks."""
    rng, stage = np.random.default_rng([seed, number]), DepthStage(pressed.tdn)
    camera = SimulatedDigit(mesh, pressed.sensor, pressed.background, int(rng.integers(2**32)))
    tilt = se3.exp(np.array([0, 0, 0, *_MOST_TILT * rng.uniform(-1, 1, 2), 0]))

    def image(depth: float) -> np.ndarray:
        return camera.look(se3.translation([0, 0, top - depth]) @ tilt).image

    background, growing = image(-_AWAY), np.arange(*_DEPTHS, _SPEED / RATES[number % len(RATES)])
    before, up, down, after = (
        [stage.process(image(depth), background) for depth in depths]
        for depths in ([-_AWAY] * _FREE, growing, growing[::-1], [-_AWAY] * _FREE)
    )
    return before + after, up, down


def report(args: argparse.Namespace) -> dict:
    """Count what is pressed and not felt, and read as shallower while the press grows."""
    sensors = progress_bar(iterable=pressed_sensors(args.tdn), unit="sensor")
    rows = [row for pressed in sensors for row in measured_ramps(pressed, args.presses, args.seed)]
    return {"tdn": args.tdn, "seed": args.seed, "ramps": rows}
