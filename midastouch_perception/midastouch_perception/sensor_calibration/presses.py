"""Which images show one whole press of the ball, and why the others do not."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

import cv2
import numpy as np

from ..sensor_model import SensorModel
from ..tdn.colour_layout import exposure_problem
from ..tdn.fit_check import QUIET_LIMIT, quietest_tenth
from ..tdn.inputs import ContactLight, reduce_image, without_drift
from .search import Contact, find_contact

_FAINT = 8.0  # grey levels of a block: less is no contact
_BLOCK = 8  # px
_EXPLAINED = 0.45  # share of the change that a ball explains
_SECOND = 0.25  # energy of another contact, of the first one's
_APART = 2.0  # radii: what is further away is not of the same contact
_VISIBLE = 0.8  # of the circle
_MOST_SATURATED = 0.25  # of the circle
_BRIGHT = 250
MOST_SPOILED = 0.5  # of an image, black or saturated


@dataclasses.dataclass(frozen=True)
class Press:
    """One image: name; change (H, W, 3) float32 grey levels at the map's resolution; contact, None if none was found;
    problem, why it is not used, empty if it is."""

    name: str
    change: np.ndarray
    contact: Contact | None
    problem: str = ""


def look_at(name: str, image: np.ndarray, light: ContactLight, ball_radius: float, sensor: SensorModel) -> Press:
    """What an image (2 H, 2 W, 3) uint8 RGB shows; sensor at the map's resolution, ball_radius m."""
    seen = light.difference(reduce_image(image)).astype(np.float32)
    change = without_drift(seen)
    if problem := image_problem(image, seen):
        return Press(name, change, None, problem)
    height, width = change.shape[:2]
    blocks = cv2.resize(change, (width // _BLOCK, height // _BLOCK), interpolation=cv2.INTER_AREA)
    if np.abs(blocks).max() < _FAINT:
        return Press(name, change, None, "nothing touches the gel")
    contact = find_contact(change, ball_radius, sensor.pixel_size)
    return Press(name, change, contact, _problem(image, change, contact, ball_radius, sensor))


def image_problem(image: np.ndarray, seen: np.ndarray) -> str:
    """Why an image (2 H, 2 W, 3) uint8 RGB that differs by `seen` (H, W, 3) grey levels from the no-contact image
    cannot be of the same sensor, whatever touches it; empty if it can."""
    if problem := exposure_problem(image, MOST_SPOILED):
        return problem
    if (quiet := quietest_tenth(seen)) > QUIET_LIMIT:
        return f"differs everywhere, by {quiet:.0f} grey levels, from the no-contact image; capture that anew"
    return ""


def reasons(presses: Sequence[Press]) -> str:
    """Why presses are not used, in words: each kind of reason once, as the first press has it."""
    kinds: dict[str, list[Press]] = {}
    for press in presses:
        if press.problem:
            kinds.setdefault(re.sub(r"\d+", "", press.problem), []).append(press)
    said = []
    for first, *others in kinds.values():
        more = f" and {len(others)} more" if others else ""
        said.append(f"{first.name}{more}: {first.problem}")
    return "; ".join(said)


def circle(contact: Contact, scale: float, sensor: SensorModel) -> np.ndarray:
    """Pixels (H, W) bool within `scale` radii of the middle of a contact."""
    rows, columns = np.mgrid[: sensor.height, : sensor.width]
    return np.hypot(columns - contact.u, rows - contact.v) < scale * contact.radius / sensor.pixel_size


def visible_share(contact: Contact, sensor: SensorModel) -> float:
    """Share (0 ... 1) of a contact's circle that is in the image."""
    return float(circle(contact, 1, sensor).sum() * sensor.pixel_area / (np.pi * contact.radius**2))


def _problem(image: np.ndarray, change: np.ndarray, contact: Contact, ball_radius: float, sensor: SensorModel) -> str:
    near = circle(contact, _APART, sensor)
    rest = np.where(near[..., None], np.float32(0), change)
    other = find_contact(rest, ball_radius, sensor.pixel_size)
    second = other.explained * float((rest**2).sum()) / max(float((change**2).sum()), 1e-9)
    if second > _SECOND * contact.explained and contact.explained + second > _EXPLAINED:
        return "two contacts"
    if contact.explained < _EXPLAINED:
        said = f"what is seen is not one ball of {2e3 * ball_radius:g} mm diameter"
        return f"{said} (it explains {100 * contact.explained:.0f} % of the change)"
    if (share := visible_share(contact, sensor)) < _VISIBLE:
        return f"cut off at the edge of the view ({100 * share:.0f} % of the contact is seen)"
    touched = circle(contact, 1, sensor)
    bright = cv2.resize((image >= _BRIGHT).any(axis=2).astype(np.float32), touched.shape[::-1])[touched].mean()
    if bright > _MOST_SATURATED:
        return f"saturated ({100 * bright:.0f} % of the contact); dim the sensor's lights (driver: intensity)"
    return ""
