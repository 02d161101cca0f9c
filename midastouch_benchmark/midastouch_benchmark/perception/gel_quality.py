"""How reliably a gel is known by its texture, and how often a change of its light is taken for a contact.

On presses of real sensors, each against its own no-contact image and those of other sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import cv2
import numpy as np

from midastouch_bringup.datasets.ball_presses import BallPresses
from midastouch_perception.gel_texture import GelCheck, gel_texture, likeness
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.sensor_calibration.response import position_terms
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet

_WINDOW = 12  # images that a verdict is of
_DRAWS = 40  # verdicts on each sensor with its own no-contact image
_TWICE = 2  # and on each other one's
_MOVED = (4, -3)  # px, rows and columns
_SPOT = 60  # px, 3 mm
SLOW_LIGHT = (0.05, 0.1, 0.2)
"""Largest change of the light within a record, as a fraction of the no-contact image."""
_RECORD = 60  # frames of one
_NOISE = 1.5  # grey levels


def gels_known(
    tdn: DepthNet,
    presses: dict[str, BallPresses],
    backgrounds: np.ndarray,
    sensor: SensorModel,
    rng: np.random.Generator,
) -> dict[str, dict[str, float]]:
    """By case, trials and the fraction of these in which the check on the gel warns.

    tdn, of the sensors' model; presses of different sensors; backgrounds (B, H, W, 3) uint8 of others, of which each
    pair is taken for one gel or not; sensor: full size.
    """
    said: dict[str, list[bool]] = {
        name: []
        for name in ("as it should be", "another gel's no-contact image", "the gel has moved", "a spot of 3 mm")
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
    textures = [gel_texture(each) for each in backgrounds]
    said["two no-contact images taken for one gel"] = [likeness(*pair).same for pair in combinations(textures, 2)]
    return {name: {"trials": len(warned), "said": float(np.mean(warned))} for name, warned in said.items() if warned}


def _with_spot(background: np.ndarray, other: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A no-contact image with the grains of another one in a square."""
    row, column = (rng.integers(_SPOT // 2, size - 1.5 * _SPOT) for size in background.shape[:2])
    square = slice(row, row + _SPOT), slice(column, column + _SPOT)
    light = [cv2.GaussianBlur(each.astype(np.float32), (0, 0), 4) for each in (background, other)]
    spoiled = background.copy()
    spoiled[square] = np.clip(light[0] + other - light[1], 0, 255)[square]
    return spoiled


def slow_light(
    tdn: DepthNet, backgrounds: Sequence[np.ndarray], sensor: SensorModel, rng: np.random.Generator
) -> list[dict[str, float]]:
    """By `SLOW_LIGHT`, frames without contact and the fraction that is taken for a contact.

    In each record the light of a no-contact image changes evenly with the time, by a quadratic in the position for
    each colour. sensor: full size.
    """
    rows = []
    for most in SLOW_LIGHT:
        contacts = []
        for background in backgrounds:
            pattern = position_terms(sensor.height, sensor.width) @ rng.normal(size=(6, 3))
            pattern *= most / np.abs(pattern).max()
            stage = DepthStage(tdn)
            for time in np.linspace(0, 1, _RECORD):
                image = background * (1 + time * pattern) + rng.normal(0, _NOISE, background.shape)
                image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
                contacts.append(stage.process(image, background).in_contact)
        rows.append({"change": most, "frames": len(contacts), "false_contacts": float(np.mean(contacts))})
    return rows
