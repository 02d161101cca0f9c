"""Simulated touches for training: an endless, seeded stream, and typical errors of the depth that sensors measure.

Real sensors have errors that the depth network does not make in simulation: the measured depth is off by a factor that
depends on the sensor, and gel that sinks in around a contact makes its outline soft. Codes must distinguish positions
in spite of them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import cv2
import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.contact_poses import ContactSampling, Reachability, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_calibration.calibration import standard_colours
from midastouch_perception.sensor_calibration.response import ColourResponse, NormalEquations, press_equations
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.inputs import ContactLight, without_drift

from ..randomisation import RandomisationRange, RandomSensor

_POSES_PER_OBJECT = 96
_SENSORS_PER_OBJECT = 8
# wider than the paper's: without small presses in training, light touches are missed
_SAMPLING = ContactSampling(press=(0.2e-3, 2e-3), free_fraction=0.04)
_ASIDE_FRACTION = 0.5  # of the touches; an arm also touches lightly, and with the gel's rim
_ASIDE_PRESS = (0.05e-3, 1.5e-3)  # m
_CALIBRATED_FRACTION = 0.4  # of the sensors whose light is relative
_BALL_FRACTION = 0.2  # of those sensors touch balls: large slopes within a small outline are rare on objects
_BALL_PRESSES = (5, 15)  # for a calibration
_BALL_RADIUS = (1.5e-3, 8e-3)  # m
_WIDEST_CONTACT = 4e-3  # m: radius of a ball's contact
_MISREAD_FRACTION = 0.5  # of the touches; the others stay as the depth network measured them
_DEPTH_FACTORS = 0.7, 1.4
_MOST_BLUR = 3.0  # pixels
_MOST_CUT_OFF = 0.1e-3  # m


@dataclasses.dataclass(frozen=True)
class TrainingTouch:
    """One simulated touch at the networks' resolution.

    Attributes: difference (H, W, 3) float32 grey levels, the depth network's input; penetration (H, W) float32 m;
    sensor, the geometry it was rendered with.
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
) -> Iterator[TrainingTouch]:
    """Yield touches on random objects with random DIGITs: 96 per object, 12 of them per DIGIT, unshuffled."""
    renderers: dict[tuple[int, int], PenetrationRenderer] = {}
    while True:
        which = int(rng.integers(len(meshes))), int(rng.integers(len(sensors)))
        if which not in renderers:
            renderers[which] = PenetrationRenderer(meshes[which[0]], sensors[which[1]])
        renderer, sensor = renderers[which], sensors[which[1]]
        poses = sample_contact_poses(meshes[which[0]], _POSES_PER_OBJECT, rng, sensor, _SAMPLING)
        poses = pressed_aside(poses, Reachability(meshes[which[0]], sensor), sensor, rng)
        penetration, normals = renderer.render_with_normals(poses)
        for part in np.array_split(np.arange(len(poses)), _SENSORS_PER_OBJECT):
            imaginary = RandomSensor(sensor, backgrounds, rng, ranges)
            response, maps, facing = None, penetration[part], normals[part]
            if sensor.light == "relative":
                if rng.random() < _CALIBRATED_FRACTION:
                    response = calibrate(imaginary, rng)
                if rng.random() < _BALL_FRACTION:
                    radius = float(rng.uniform(*_BALL_RADIUS))
                    maps = np.maximum(ball_presses(radius, len(part), sensor, rng), 0)
                    facing = np.zeros((*maps.shape, 3), np.float32)
            images, reference = imaginary.images(maps, facing, rng)
            light = ContactLight(reference, sensor.light)
            for image, depth in zip(images, maps, strict=True):
                difference = light.difference(image)
                seen = standard_colours(response.slopes(difference)) if response else difference
                yield TrainingTouch(seen, depth, sensor)


def pressed_aside(
    poses: np.ndarray, reachability: Reachability, sensor: SensorModel, rng: np.random.Generator
) -> np.ndarray:
    """Return poses T_obj_gel (N, 4, 4), half of them moved in the gel's plane so that the contact is anywhere in view,
    and pressed by 0.05 to 1.5 mm, log-uniform. A pose that then touches nothing stays as it was."""
    aside = np.flatnonzero(rng.random(len(poses)) < _ASIDE_FRACTION)
    view = 0.5 * sensor.pixel_size * np.array([sensor.width, sensor.height])
    moves = np.zeros((len(aside), 3))
    moves[:, :2] = rng.uniform(-view, view, (len(aside), 2))
    low, high = np.log(_ASIDE_PRESS)
    press = np.exp(rng.uniform(low, high, len(aside)))
    moved, touching = reachability.pressed(poses[aside] @ se3.translation(moves), press)
    out = poses.copy()
    out[aside[touching]] = moved[touching]
    return out


def ball_presses(radius: float, n: int, sensor: SensorModel, rng: np.random.Generator) -> np.ndarray:
    """Return the penetration (n, H, W) float32 m of a ball at random positions, negative outside of the contact."""
    presses = []
    for _ in range(n):
        u, v = rng.uniform(0.05, 0.95, 2) * (sensor.width, sensor.height)
        contact = min(rng.uniform(0.25, 0.85) * radius, _WIDEST_CONTACT)
        presses.append(ball_penetration(ball_centre(u, v, contact, radius, sensor), radius, sensor))
    return np.stack(presses)


def calibrate(imaginary: RandomSensor, rng: np.random.Generator) -> ColourResponse:
    """Return the response of an imaginary sensor's colours to slopes, fitted to simulated presses of a ball."""
    sensor, radius = imaginary.sensor, float(rng.uniform(2e-3, 6e-3))
    presses = ball_presses(radius, int(rng.integers(*_BALL_PRESSES)), sensor, rng)
    contacts = np.maximum(presses, 0)
    images, reference = imaginary.images(contacts, np.zeros((*contacts.shape, 3), np.float32), rng)
    light, equations = ContactLight(reference, sensor.light), NormalEquations()
    for image, penetration in zip(images, presses, strict=True):
        equations += press_equations(without_drift(light.difference(image)), penetration, sensor.pixel_size)
    return ColourResponse(equations.solve())


def shuffled(stream: Iterator[TrainingTouch], size: int, rng: np.random.Generator) -> Iterator[TrainingTouch]:
    """Yield the stream in random order, through a reservoir of `size` touches."""
    reservoir = [next(stream) for _ in range(size)]
    while True:
        slot = int(rng.integers(size))
        yield reservoir[slot]
        reservoir[slot] = next(stream)


def misread(maps: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return penetration maps (N, H, W) float32 m, half of them as an inaccurate sensor measures them: depth scaled by
    0.7 to 1.4, and half of these also blurred by up to 3 pixels and cut off below a depth of at most 0.1 mm."""
    out = maps.copy()
    for i in np.flatnonzero(rng.random(len(maps)) < _MISREAD_FRACTION):
        out[i] *= np.exp(rng.uniform(*np.log(_DEPTH_FACTORS)))
        if rng.random() < 0.5:
            soft = cv2.GaussianBlur(out[i], (0, 0), rng.uniform(0.3, _MOST_BLUR))
            out[i] = np.where(soft > rng.uniform(0.1, 1) * min(_MOST_CUT_OFF, 0.5 * soft.max()), soft, 0)
    return out
