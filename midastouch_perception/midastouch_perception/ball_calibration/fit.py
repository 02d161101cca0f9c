"""The calibration of a sensor from presses of one ball: which are used, the fit, and how well it does on others."""

from __future__ import annotations

import dataclasses
from datetime import datetime, timezone

import numpy as np

from ..errors import InputError
from ..sensor_calibration import SensorCalibration, background_colours, plain_slopes
from ..sensor_model import SensorModel
from ..tdn.inputs import ContactLight, check_image, reduce_image
from .ball import ball_centre, ball_penetration
from .diameter import diameter_doubt, felt_radius
from .presses import Press, background_behind, look_at, visible_share
from .refine import refine_contacts
from .response import NormalEquations, height_slopes, press_equations

FEWEST, MOST = 5, 40
_EXPLAINED = 0.3  # of a press, by the light of all
_VISIBLE = 0.7
_FOLDS = 5
_WIDEST = 0.93  # median contact radius, of the ball's: the search ends there
_STRENGTH = 0.42, 1.25  # colour by slope, of the standard sensor's, that any DIGIT measured has
_AGREEMENT = 0.5  # share of the slopes that the fit explains on presses it has not seen


@dataclasses.dataclass(frozen=True)
class Result:
    """calibration; presses, all images as judged; sensor, at the map's resolution; background (320, 240, 3) uint8;
    held_out, the calibration of each press from the others (None where it is not used); figures of the held-out ones
    (`cross_validation`); doubt about the ball's diameter, in words, empty if there is none."""

    calibration: SensorCalibration
    presses: list[Press]
    sensor: SensorModel
    background: np.ndarray
    held_out: list[SensorCalibration | None]
    figures: dict[str, float]
    doubt: str


def calibrate(
    images: dict[str, np.ndarray],
    background: np.ndarray | None,
    ball_diameter: float,
    sensor: SensorModel,
    serial: str = "",
) -> Result:
    """Calibrate from images (320, 240, 3) uint8 RGB by name, of presses of a ball of `ball_diameter` m.

    background: no-contact image, or None for the median of the images without their contacts. sensor: full size.
    Raises InputError if the images do not allow it: fewer than five usable presses, another ball, another background.
    """
    if not FEWEST <= len(images) <= MOST:
        raise InputError(f"{len(images)} images; calibration needs {FEWEST} to {MOST} presses, in different places")
    for name, image in images.items():
        check_image(image, sensor, name)
    half, radius = sensor.for_maps, 0.5 * ball_diameter
    if background is None:
        background = background_behind(list(images.values()), radius, half)
    light = ContactLight(reduce_image(check_image(background, sensor, "background")), sensor.light)
    presses = [look_at(name, image, light, radius, half) for name, image in images.items()]
    _require_enough(presses)
    presses = _refined(presses, radius, half)
    _require_enough(presses)
    _check_diameter(presses, ball_diameter, half)
    pressed = [images[press.name] for press in presses if not press.problem]
    doubt = diameter_doubt(felt_radius(pressed, background, sensor), ball_diameter)

    equations = [_equations(press, radius, half) for press in presses]
    used = [i for i, press in enumerate(presses) if not press.problem]
    made = {
        "serial": serial,
        "ball_diameter": ball_diameter,
        "sensor": sensor.name,
        "pixel_size": sensor.pixel_size,
        "background": background_colours(background),
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }

    def solved(indices: list[int]) -> SensorCalibration:
        total = sum((equations[i] for i in indices), NormalEquations())
        return SensorCalibration(coefficients=total.solve(), presses=len(indices), **made)

    folds = [solved([i for k, i in enumerate(used) if k % _FOLDS != fold]) for fold in range(_FOLDS)]
    held_out: list[SensorCalibration | None] = [None] * len(presses)
    for k, i in enumerate(used):
        held_out[i] = folds[k % _FOLDS]
    figures = cross_validation(presses, held_out, radius, half)
    if figures["explained_after"] < _AGREEMENT:
        raise InputError(
            f"the presses do not agree with one ball of {1e3 * ball_diameter:g} mm (a calibration explains "
            f"{100 * figures['explained_after']:.0f} % of the slopes of presses it has not seen); press the same ball, "
            "straight and without sliding, and give its diameter"
        )
    return Result(solved(used), presses, half, background, held_out, figures, doubt)


def cross_validation(
    presses: list[Press], held_out: list[SensorCalibration | None], ball_radius: float, sensor: SensorModel
) -> dict[str, float]:
    """How well slopes are known in each used press's contact, by a calibration that has not seen it (medians).

    explained_before, explained_after: share of the ball's slopes explained without and with calibration;
    felt_radius_before, felt_radius_after [m]: of the ball with these slopes.
    """
    rows = []
    for press, calibration in zip(presses, held_out, strict=True):
        if calibration is None:
            continue
        truth, inside = contact_slopes(press, ball_radius, sensor)
        row = []
        for slopes in (plain_slopes(press.change), calibration.response.slopes(press.change)):
            error, scale = (slopes - truth)[inside], float((truth[inside] ** 2).sum())
            # a ball's slopes are position over radius, nearly
            steepness = float((slopes[inside] * truth[inside]).sum()) / scale
            row += [1 - float((error**2).sum()) / scale, ball_radius / max(steepness, 0.05)]
        rows.append(row)
    names = ("explained_before", "felt_radius_before", "explained_after", "felt_radius_after")
    return dict(zip(names, np.median(rows, axis=0).tolist(), strict=True))


def contact_slopes(press: Press, ball_radius: float, sensor: SensorModel) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (H, W, 2) of the ball in a press, and where (H, W) bool it touches."""
    penetration = penetration_of(press, ball_radius, sensor)
    return height_slopes(np.maximum(penetration, 0), sensor.pixel_size), penetration > 0


def penetration_of(press: Press, ball_radius: float, sensor: SensorModel) -> np.ndarray:
    """Penetration (H, W) m of the ball in a press, negative beside its contact."""
    contact = press.contact
    return ball_penetration(ball_centre(contact.u, contact.v, contact.radius, ball_radius, sensor), ball_radius, sensor)


def _equations(press: Press, ball_radius: float, sensor: SensorModel) -> NormalEquations:
    if press.problem:
        return NormalEquations()
    return press_equations(press.change, penetration_of(press, ball_radius, sensor), sensor.pixel_size)


def _refined(presses: list[Press], ball_radius: float, sensor: SensorModel) -> list[Press]:
    used = [press for press in presses if not press.problem]
    contacts = refine_contacts([p.change for p in used], [p.contact for p in used], ball_radius, sensor)
    moved = {}
    for press, contact in zip(used, contacts, strict=True):
        problem = ""
        if contact.explained < _EXPLAINED:
            problem = f"unlike the other presses (their light explains {100 * contact.explained:.0f} % of it)"
        elif visible_share(contact, sensor) < _VISIBLE:
            problem = "cut off at the edge of the view"
        moved[press.name] = dataclasses.replace(press, contact=contact, problem=problem)
    return [moved.get(press.name, press) for press in presses]


def _require_enough(presses: list[Press]) -> None:
    usable = sum(not press.problem for press in presses)
    if usable < FEWEST:
        reasons = "; ".join(f"{press.name}: {press.problem}" for press in presses if press.problem)
        raise InputError(f"{usable} of {len(presses)} presses can be used, {FEWEST} are needed. {reasons}")


def _check_diameter(presses: list[Press], ball_diameter: float, sensor: SensorModel) -> None:
    radius = 0.5 * ball_diameter
    used = [press for press in presses if not press.problem]
    widest = float(np.median([press.contact.radius for press in used])) / radius
    if widest > _WIDEST:
        raise InputError(f"the contacts are too wide for a ball of {1e3 * ball_diameter:g} mm; give its true diameter")
    strength = []  # across and along the finger, and altogether
    for press in used:
        truth, inside = contact_slopes(press, radius, sensor)
        product, square = plain_slopes(press.change)[inside] * truth[inside], truth[inside] ** 2
        strength.append([*(product.sum(axis=0) / square.sum(axis=0)), product.sum() / square.sum()])
    across, along, middle = np.median(strength, axis=0)
    if min(across, along) < 0:
        raise InputError(
            "the colours answer to slopes the other way round than on other DIGITs: the images are turned or mirrored, "
            "have red and blue swapped, or the no-contact image shows a contact; check the driver's rotation and "
            "encoding, and capture the no-contact image anew"
        )
    if not _STRENGTH[0] < middle < _STRENGTH[1]:
        likely = 1e3 * ball_diameter / middle
        raise InputError(
            f"for a ball of {1e3 * ball_diameter:g} mm the colours change {middle:.1f} times as much as on other "
            f"DIGITs; one of about {likely:.0f} mm would fit. Give the true diameter in metres"
        )
