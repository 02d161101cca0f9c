"""Judgement of images of presses: does each show one whole press of the ball, and what is their no-contact image?"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from midastouch_common.errors import InputError

from ..gel_texture import CLEAR, gel_texture, likeness
from ..sensor_model import SensorModel
from ..tdn.background import estimate_background, shows_contact
from ..tdn.colour_layout import exposure_problem, image_problem
from ..tdn.fit_check import QUIET_LIMIT, quietest_tenth
from ..tdn.inference import load_tdn
from ..tdn.inputs import ContactLight, check_image, coarse, reduce_image, without_drift
from .ball import BallContact, find_contact

_LEAST_CHANGE = 8.0  # grey levels of a block: less is no contact
_BLOCK = 8  # px
_LEAST_EXPLAINED = 0.45  # fraction of the change that a ball explains
_MOST_SECOND_ENERGY = 0.25  # energy of a second contact, relative to the first one's
_CONTACT_REACH = 2.0  # radii; a change beyond belongs to another contact
_LEAST_VISIBLE = 0.8  # of the circle
_MOST_SATURATED = 0.25  # of the circle
_SATURATED_LEVEL = 250
MOST_SPOILED = 0.5  # of an image, black or saturated
_MASK_RADII = 1.7  # radii of the circle around a press that does not count as background
_MASK_PASSES = 2
_MOST_HIDDEN = 0.02  # of the image


@dataclasses.dataclass(frozen=True)
class Press:
    """One image of a press: name; change (H, W, 3) float32 grey levels at the map's resolution; contact, None if none
    was found; problem, reason why it is not used, empty if it is."""

    name: str
    change: np.ndarray
    contact: BallContact | None
    problem: str = ""


def look_at(name: str, image: np.ndarray, light: ContactLight, ball_radius: float, sensor: SensorModel) -> Press:
    """Judge an image (2 H, 2 W, 3) uint8 RGB of a press; sensor at the map's resolution, ball_radius m."""
    seen = light.difference(reduce_image(image)).astype(np.float32)
    change = without_drift(seen)
    if problem := sensor_mismatch(image, seen):
        return Press(name, change, None, problem)
    if np.abs(coarse(change, _BLOCK)).max() < _LEAST_CHANGE:
        return Press(name, change, None, "nothing touches the gel")
    contact = find_contact(change, ball_radius, sensor.pixel_size)
    return Press(name, change, contact, _problem(image, change, contact, ball_radius, sensor))


def sensor_mismatch(image: np.ndarray, seen: np.ndarray) -> str:
    """Return the reason why an image (2 H, 2 W, 3) uint8 RGB that differs by `seen` (H, W, 3) grey levels from the
    no-contact image cannot be of the same sensor under any touch; empty if it can."""
    if problem := exposure_problem(image, MOST_SPOILED):
        return problem
    if (quiet := quietest_tenth(seen)) > QUIET_LIMIT:
        return f"differs everywhere, by {quiet:.0f} grey levels, from the no-contact image; capture that again"
    return ""


def reasons(presses: Sequence[Press]) -> str:
    """Return the reasons why presses are not used, as text: each kind of reason once, with its first press."""
    kinds: dict[str, list[Press]] = {}
    for press in presses:
        if press.problem:
            kinds.setdefault(re.sub(r"\d+", "", press.problem), []).append(press)
    said = []
    for first, *others in kinds.values():
        more = f" and {len(others)} more" if others else ""
        said.append(f"{first.name}{more}: {first.problem}")
    return "; ".join(said)


def circle(contact: BallContact, scale: float, sensor: SensorModel) -> np.ndarray:
    """Return the pixels (H, W) bool within `scale` radii of the middle of a contact."""
    rows, columns = np.mgrid[: sensor.height, : sensor.width]
    return np.hypot(columns - contact.u, rows - contact.v) < scale * contact.radius / sensor.pixel_size


def visible_fraction(contact: BallContact, sensor: SensorModel) -> float:
    """Return the fraction (0 ... 1) of a contact's circle that is in the image."""
    return float(circle(contact, 1, sensor).sum() * sensor.pixel_area / (np.pi * contact.radius**2))


def _problem(
    image: np.ndarray, change: np.ndarray, contact: BallContact, ball_radius: float, sensor: SensorModel
) -> str:
    near = circle(contact, _CONTACT_REACH, sensor)
    rest = np.where(near[..., None], np.float32(0), change)
    other = find_contact(rest, ball_radius, sensor.pixel_size)
    second = other.explained * float((rest**2).sum()) / max(float((change**2).sum()), 1e-9)
    if second > _MOST_SECOND_ENERGY * contact.explained and contact.explained + second > _LEAST_EXPLAINED:
        return "two contacts"
    if contact.explained < _LEAST_EXPLAINED:
        said = f"what is seen is not one ball of {2e3 * ball_radius:g} mm diameter"
        return f"{said} (it explains {100 * contact.explained:.0f} % of the change)"
    if (visible := visible_fraction(contact, sensor)) < _LEAST_VISIBLE:
        return f"cut off at the edge of the view ({100 * visible:.0f} % of the contact is seen)"
    touched = circle(contact, 1, sensor)
    bright = cv2.resize((image.max(axis=2) >= _SATURATED_LEVEL).astype(np.float32), touched.shape[::-1])[touched].mean()
    if bright > _MOST_SATURATED:
        return f"saturated ({100 * bright:.0f} % of the contact); dim the sensor's lights (driver: intensity)"
    return ""


def require_no_contact(background: np.ndarray, images: list[np.ndarray], sensor: SensorModel) -> None:
    """Raise InputError unless a no-contact image (320, 240, 3) uint8 RGB can belong to `images` of a pressed sensor.

    It is refused if it has another size, is black or saturated, or shows a touch that the images do not. sensor: full
    size.
    """
    check_image(background, sensor, "background")
    if problem := image_problem(background, None):
        raise InputError(problem)
    if shows_contact(load_tdn("fast", sensor), background, estimate_background(images)):
        raise InputError(
            "the no-contact image shows a touch that the other images do not have; lift the finger and capture it again"
        )


def background_behind(images: list[np.ndarray], ball_radius: float, sensor: SensorModel) -> np.ndarray:
    """Return the no-contact image (2 H, 2 W, 3) uint8 from presses alone: the median of the images without contacts.

    ball_radius m; sensor at the map's resolution. Raises InputError if the presses leave too little gel free.
    """
    background = estimate_background(images)
    for _ in range(_MASK_PASSES):
        light = ContactLight(reduce_image(background), sensor.light)
        covered = []
        for image in images:
            change = without_drift(light.difference(reduce_image(image)))
            contact = find_contact(change, ball_radius, sensor.pixel_size)
            near = circle(contact, _MASK_RADII, sensor).astype(np.uint8)
            covered.append(cv2.resize(near, image.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0)
        hidden = np.all(covered, axis=0)
        pressed = np.repeat(np.stack(covered)[..., None] & ~hidden[..., None], 3, axis=3)
        masked: np.ma.MaskedArray = np.ma.masked_array(images, pressed)
        background = np.ma.median(masked, axis=0).filled(0).astype(np.uint8)
    if hidden.mean() > _MOST_HIDDEN:
        raise InputError(
            f"{100 * hidden.mean():.0f} % of the gel is pressed in every image, so they do not show the no-contact "
            "image; put one beside them as background.png"
        )
    return background


def texture_behind(
    background: np.ndarray, images: dict[str, np.ndarray], presses: list[Press], sensor: SensorModel
) -> tuple[np.ndarray, float]:
    """Return the texture of a gel in its no-contact image, and its likeness, in standard deviations, to the texture
    around the ball in all used presses; sensor at the map's resolution.

    Raises InputError if the presses have another texture.
    """
    texture = gel_texture(background)
    halves: list[Any] = [0.0, 0.0]
    for k, press in enumerate(press for press in presses if not press.problem):
        halves[k % 2] = halves[k % 2] + gel_texture(images[press.name], circle(press.contact, _MASK_RADII, sensor))
    found = likeness(texture, halves[0] + halves[1])
    if texture.any() and not found.same and likeness(*halves).sigmas >= CLEAR:
        raise InputError(
            "the no-contact image is of another gel: the fine texture of the presses is not found in it; lift the "
            "finger, call capture_background, and press again if the gel was changed meanwhile"
        )
    return texture, found.sigmas
