"""The no-contact image of presses: whether the one that is given is theirs, and else the one that is behind them."""

from __future__ import annotations

import cv2
import numpy as np

from midastouch_common.errors import InputError

from ..sensor_model import SensorModel
from ..tdn.background import estimate_background, shows_contact
from ..tdn.colour_layout import image_problem
from ..tdn.inference import load_tdn
from ..tdn.inputs import ContactLight, check_image, reduce_image, without_drift
from .presses import circle
from .search import find_contact

_MASK = 1.7  # radii around a press that are no background
_PASSES = 2
_NEVER_FREE = 0.02  # of the image


def require_no_contact(background: np.ndarray, images: list[np.ndarray], sensor: SensorModel) -> None:
    """Raises InputError if a no-contact image (320, 240, 3) uint8 RGB is none of a sensor that is pressed in `images`
    of the same size: of another size, black, saturated, or with a touch in it that the images do not share. sensor:
    full size."""
    check_image(background, sensor, "background")
    if problem := image_problem(background, None):
        raise InputError(problem)
    if shows_contact(load_tdn("fast", sensor), background, estimate_background(images)):
        raise InputError(
            "the no-contact image shows a touch that the other images do not have; lift the finger and capture it anew"
        )


def background_behind(images: list[np.ndarray], ball_radius: float, sensor: SensorModel) -> np.ndarray:
    """No-contact image (2 H, 2 W, 3) uint8 from presses alone: the median of the images without what touches.

    ball_radius m; sensor at the map's resolution. Raises InputError where the presses leave too little gel free.
    """
    background = estimate_background(images)
    for _ in range(_PASSES):
        light = ContactLight(reduce_image(background), sensor.light)
        covered = []
        for image in images:
            change = without_drift(light.difference(reduce_image(image)))
            contact = find_contact(change, ball_radius, sensor.pixel_size)
            near = circle(contact, _MASK, sensor).astype(np.uint8)
            covered.append(cv2.resize(near, image.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0)
        hidden = np.all(covered, axis=0)
        masked = np.ma.masked_array(images, np.repeat(np.stack(covered)[..., None] & ~hidden[..., None], 3, axis=3))
        background = np.ma.median(masked, axis=0).filled(0).astype(np.uint8)
    if hidden.mean() > _NEVER_FREE:
        raise InputError(
            f"{100 * hidden.mean():.0f} % of the gel is pressed in every image, so the no-contact image cannot be told "
            "from them; put one beside them as background.png"
        )
    return background
