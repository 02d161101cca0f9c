"""Reliability of recognising a gel by its texture, on presses of real sensors.

Each sensor is compared with its own no-contact image and with those of other sensors.
"""

from __future__ import annotations

import dataclasses
from itertools import combinations

import cv2
import numpy as np

from midastouch_perception.gel_texture import GelCheck, gel_texture, likeness
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, background_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet
from midastouch_tools.datasets.ball_presses import BallPresses

from .check_quality import as_bytes

_WINDOW = 12  # images of a verdict
_DRAWS = 40  # verdicts on each sensor with its own no-contact image
_TWICE = 2  # verdicts with each no-contact image of another sensor
_MOVED = (4, -3)  # px, rows and columns
_SPOT = 60  # px, 3 mm
_NO_RESPONSE = np.zeros((12, 6, 2))  # of a calibration: another gel is recognised without it
_BRIGHTER, _NOISE = 0.1, 1.5  # standard deviation of the light's logarithm by colour; of a pixel, grey levels


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
        for calibration, how in _calibrations(each, penetrations, sensor):
            said["another gel's calibration" + how] += [bool(calibration.background_problem(other)) for other in others]
            said["its own calibration, in another light" + how] += [
                bool(calibration.background_problem(_in_another_light(each.background, rng))) for _ in range(_DRAWS)
            ]
    textures = [gel_texture(each) for each in backgrounds]
    said["two no-contact images taken for one gel"] = [likeness(*pair).same for pair in combinations(textures, 2)]
    return {name: {"trials": len(warned), "said": float(np.mean(warned))} for name, warned in said.items() if warned}


def _calibrations(
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
