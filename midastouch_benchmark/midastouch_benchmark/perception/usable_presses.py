"""Which images of presses can be judged at all, and why the others cannot."""

from __future__ import annotations

import numpy as np

from midastouch_bringup.datasets.ball_presses import BACKGROUND, BallPresses
from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration import presses as ball_presses
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import colour_layout
from midastouch_perception.tdn.inputs import ContactLight, reduce_image, without_drift

from .press_quality import visible_contact


def usable_presses(presses: BallPresses, sensor: SensorModel) -> tuple[BallPresses, dict[str, str]]:
    """The presses that show something on this sensor, and by file name why the others do not.

    sensor at full size. Repeated images are among the others. Raises InputError if the no-contact image shows nothing,
    or no press can be used.
    """
    if problem := colour_layout.image_problem(presses.background, None):
        raise InputError(f"{BACKGROUND}, or what the presses have in common: {problem}")
    light = ContactLight(reduce_image(presses.background), sensor.light)
    problems = {name: f"the same image as {first}" for name, first in presses.repeated.items()}
    for name, image in presses.images.items():
        if problem := _problem(image, presses.background, light, sensor):
            problems[name] = problem
    usable = [name for name in presses.images if name not in problems]
    if not usable:
        name, problem = next(iter(problems.items()))
        raise InputError(f"none of {len(presses.images)} presses can be used. {name}: {problem}")
    return presses.only(usable), problems


def _problem(image: np.ndarray, background: np.ndarray, light: ContactLight, sensor: SensorModel) -> str:
    seen = light.difference(reduce_image(image))
    return (
        colour_layout.exposure_problem(image, ball_presses.MOST_SPOILED)
        # an image that is turned differs everywhere too; how it is turned says more
        or colour_layout.turned_since(image, background)
        or ball_presses.sensor_mismatch(image, seen)
        or ("" if visible_contact(without_drift(seen), sensor.for_maps).any() else "nothing touches the gel")
    )
