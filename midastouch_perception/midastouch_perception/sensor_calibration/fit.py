"""Calibration of a sensor from presses of one ball: selection of presses, fit, and accuracy on other presses."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timezone

import numpy as np

from midastouch_common.errors import InputError

from ..sensor_model import DIGIT_LAMPS, SensorModel
from ..tdn.inputs import ContactLight, check_image, reduce_image
from .ball import ball_centre, ball_penetration
from .calibration import Fusion, SensorCalibration, background_colours, plain_slopes
from .fusion import chosen_fusion, fusion_errors
from .network_checks import (
    depth_errors,
    diameter_doubt,
    gain_doubt,
    measured_maps,
    measured_radius,
    radius_doubt,
    stretch_doubt,
)
from .presses import Press, background_behind, look_at, reasons, require_no_contact, texture_behind, visible_fraction
from .refine import refine_contacts
from .response import NormalEquations, height_slopes, press_equations, well_inside

MOST = 40
_LEAST_SPREAD = 1 / 16  # of the image: a quarter of its width and of its height
_LEAST_EXPLAINED = 0.3  # of a press, by the light fitted to all
_LEAST_VISIBLE = 0.7
_WIDEST_CONTACT = 0.93  # median contact radius, relative to the ball's; the search ends shortly above
_SAME_POSITION = 0.3e-3  # m between two contacts; if their radii are the same, too, one press was saved twice
_SAME_RADIUS = 0.1  # fraction by which such radii may differ
_LEAST_AGREEMENT = 0.5  # fraction of the slopes that the fit explains on presses not used for it
FEWEST = 5
_FOLDS = 5
_LEAST_STEEP = 0.05


def fitted(
    changes: Sequence[np.ndarray], penetrations: Sequence[np.ndarray | None], pixel: float, made: dict
) -> tuple[SensorCalibration, list[SensorCalibration | None]]:
    """Return the calibration from all touches, and for each touch the one from other folds (None for an unused touch).

    changes (H, W, 3) grey levels; penetrations (H, W) m, negative outside the contact, None for a touch that is not
    used; pixel, m per pixel; made, the other fields of a `SensorCalibration`.
    """
    used = [i for i, penetration in enumerate(penetrations) if penetration is not None]
    equations = {i: press_equations(changes[i], penetrations[i], pixel) for i in used}

    def solved(indices: list[int]) -> SensorCalibration:
        total = sum((equations[i] for i in indices), NormalEquations())
        return SensorCalibration(coefficients=total.solve(), presses=len(indices), **made)

    folds = [solved([i for k, i in enumerate(used) if k % _FOLDS != fold]) for fold in range(_FOLDS)]
    return solved(used), _in_turn(folds, penetrations)


def joined_as_measured(
    calibration: SensorCalibration, held_out: Sequence[SensorCalibration | None], errors: Mapping[Fusion, np.ndarray]
) -> tuple[SensorCalibration, list[SensorCalibration | None]]:
    """Return calibrations, as of `fitted`, with the fusion chosen by all touches, and for each touch by other folds.

    errors (N, 3) of the used touches, of `fusion_errors`.
    """

    def joined(calibration: SensorCalibration, rows: np.ndarray) -> SensorCalibration:
        weight, growth = chosen_fusion({choice: values[rows] for choice, values in errors.items()})
        return dataclasses.replace(calibration, network_weight=weight, outline_growth=growth)

    used = [each for each in held_out if each is not None]
    fold_of = np.arange(len(used)) % _FOLDS
    folds = [joined(used[fold], fold_of != fold) for fold in range(_FOLDS)]
    return joined(calibration, fold_of >= 0), _in_turn(folds, held_out)


def _in_turn(folds: Sequence[SensorCalibration], touches: Sequence[object]) -> list[SensorCalibration | None]:
    """Return the calibrations of folds, to which touches belong in turn; None for one that is None, and not used."""
    turns = itertools.cycle(folds)
    return [None if touch is None else next(turns) for touch in touches]


def cross_validation(
    changes: Sequence[np.ndarray],
    penetrations: Sequence[np.ndarray | None],
    held_out: Sequence[SensorCalibration | None],
    sensor: SensorModel,
) -> dict[str, float]:
    """Return the accuracy of slopes in each used touch's contact, by the calibration without that touch (medians).

    explained_before, explained_after: fraction of the true slopes explained without and with calibration;
    steepness_before, steepness_after: steepness of the slopes relative to the true ones. sensor: at the maps'
    resolution.
    """
    rows, slopes_before = [], _slopes_without(sensor)
    for change, penetration, calibration in zip(changes, penetrations, held_out, strict=True):
        if calibration is None:
            continue
        truth, inside = contact_slopes(penetration, sensor.pixel_size)
        row = []
        for slopes in (slopes_before(change), calibration.response.slopes(change)):
            error, scale = (slopes - truth)[inside], float((truth[inside] ** 2).sum())
            steepness = float((slopes[inside] * truth[inside]).sum()) / scale
            row += [1 - float((error**2).sum()) / scale, max(steepness, _LEAST_STEEP)]
        rows.append(row)
    names = ("explained_before", "steepness_before", "explained_after", "steepness_after")
    return dict(zip(names, np.median(rows, axis=0).tolist(), strict=True))


def turned_doubt(changes: Sequence[np.ndarray], penetrations: Sequence[np.ndarray], sensor: SensorModel) -> str:
    """Return a message if the colours respond to slopes the other way round than on other sensors with these lamps.

    Otherwise it is empty. Both axes are checked, against the slopes of the touching object; unknown lamps are not.
    changes (H, W, 3) grey levels; penetrations (H, W) m; sensor: at the maps' resolution.
    """
    if not sensor.lamps:
        return ""
    slopes_of, agreement = _slopes_without(sensor), []
    for change, penetration in zip(changes, penetrations, strict=True):
        truth, inside = contact_slopes(penetration, sensor.pixel_size)
        agreement.append((slopes_of(change)[inside] * truth[inside]).sum(axis=0))
    if np.median(agreement, axis=0).min() >= 0:
        return ""
    return (
        f"the colours answer to slopes the other way round than on others with the lamps of a {sensor.lamps}: the "
        "images are turned or mirrored, have red and blue swapped, or the no-contact image shows a contact; check the "
        "driver's rotation and encoding, and capture the no-contact image anew"
    )


def _slopes_without(sensor: SensorModel) -> Callable[[np.ndarray], np.ndarray]:
    """Return the slopes by changes of colours that are in use on a sensor without a calibration of its own."""
    default = SensorCalibration.default(sensor)
    return plain_slopes if default is None else default.response.slopes


def contact_slopes(penetration: np.ndarray, pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes (H, W, 2) of an object with a penetration (H, W) m, and the pixels (H, W) bool where the gel
    has them."""
    return height_slopes(np.maximum(penetration, 0), pixel), well_inside(penetration)


@dataclasses.dataclass(frozen=True)
class Result:
    """Calibration with its input and its accuracy.

    Attributes: calibration; presses, all images with their judgement; penetrations (H, W) m of the ball in each, 0 or
    less outside the contact (None for an unused press); sensor, at the map's resolution; background (320, 240, 3)
    uint8; held_out, the calibration of each press from the others (None for an unused one); figures of the held-out
    ones (`cross_validation` and `depth_errors`; and the ball's radius [m] by the slopes, felt_radius_before and
    felt_radius_after, and by the depth, depth_radius_before and depth_radius_after); doubt, reason why the diameter of
    the ball or the images are improbable, empty if they are plausible.
    """

    calibration: SensorCalibration
    presses: list[Press]
    penetrations: list[np.ndarray | None]
    sensor: SensorModel
    background: np.ndarray
    held_out: list[SensorCalibration | None]
    figures: dict[str, float]
    doubt: str = ""

    @property
    def warnings(self) -> list[str]:
        """Doubts to consider before using the calibration, as text."""
        off = radius_doubt(self.figures, self.calibration.ball_diameter)
        return [said for said in (self.doubt, off, gain_doubt(self.figures)) if said]


def calibrate(
    images: dict[str, np.ndarray],
    background: np.ndarray | None,
    ball_diameter: float,
    sensor: SensorModel,
    serial: str = "",
    diameter_is_right: bool = False,
) -> Result:
    """Calibrate one sensor by presses of a ball.

    Parameters
    ----------
    images : images (320, 240, 3) uint8 RGB of presses, by name
    background
        No-contact image, or None for the median of the images without their contacts.
    ball_diameter : [m]
    sensor
        Sensor model, full size.
    serial
        Serial number of the sensor, "" if unknown.
    diameter_is_right
        With True, the diameter is accepted even if the depth network measures another one.

    Returns
    -------
    Result
        The calibration, and what it was made from.

    Raises
    ------
    InputError
        The images do not allow it: fewer than five usable presses, another ball, another background.
    """
    require_ball(ball_diameter, sensor)
    if not FEWEST <= len(images) <= MOST:
        fix = "press the ball at more positions" if len(images) < FEWEST else "leave some of them out"
        raise InputError(
            f"{len(images)} images; calibration needs {FEWEST} to {MOST} presses at different positions; {fix}"
        )
    for name, image in images.items():
        check_image(image, sensor, name)
    half, radius = sensor.for_maps, 0.5 * ball_diameter
    given = background is not None
    if given:
        require_no_contact(background, list(images.values()), sensor)
    else:
        background = background_behind(list(images.values()), radius, half)
    light = ContactLight(reduce_image(background), sensor.light)
    presses = [look_at(name, image, light, radius, half) for name, image in images.items()]
    _require_enough(presses, given)
    presses = _once_each(_refined(presses, radius, half), half)
    _require_enough(presses, given)
    _require_spread(presses, half)
    _require_one_ball(presses, ball_diameter)
    penetrations = [None if press.problem else penetration_of(press, radius, half) for press in presses]
    used = [press for press in presses if not press.problem]
    turned = turned_doubt([press.change for press in used], [each for each in penetrations if each is not None], half)
    if turned and sensor.lamps == DIGIT_LAMPS:
        raise InputError(turned)
    maps = measured_maps([images[press.name] for press in used], background, sensor)
    doubt = diameter_doubt(measured_radius(maps, half.pixel_size), ball_diameter, sensor)
    if doubt and sensor.lamps == DIGIT_LAMPS and not diameter_is_right:
        raise InputError(
            f"{doubt}; measure its diameter and give it in metres, or if it is right, say so (--diameter-is-right, or "
            "the node's parameter diameter_is_right)"
        )

    changes = [press.change for press in presses]
    texture, sigmas = texture_behind(background, images, presses, half)
    made = _made_of(background, sensor, serial, ball_diameter) | {"texture": texture, "texture_sigmas": sigmas}
    calibration, held_out = fitted(changes, penetrations, half.pixel_size, made)
    seen = [images[press.name] for press in presses]
    errors = fusion_errors(seen, penetrations, held_out, background, sensor)
    calibration, held_out = joined_as_measured(calibration, held_out, errors)
    figures = cross_validation(changes, penetrations, held_out, half)
    # a ball's slopes are approximately position over radius
    figures |= {f"felt_radius_{when}": radius / figures[f"steepness_{when}"] for when in ("before", "after")}
    if figures["explained_after"] < _LEAST_AGREEMENT:
        raise InputError(
            f"the presses do not agree with one ball of {1e3 * ball_diameter:g} mm (a calibration explains "
            f"{100 * figures['explained_after']:.0f} % of the slopes of presses it has not seen); press the same ball "
            "more often, straight and without sliding, give its diameter, and see that nothing touches in the "
            "no-contact image"
        )
    figures |= depth_errors(seen, penetrations, held_out, background, sensor)
    figures |= {f"depth_radius_{when}": radius / figures[f"curvature_{when}"] for when in ("before", "after")}
    doubts = "; ".join(filter(None, (doubt, turned, stretch_doubt(maps))))
    return Result(calibration, presses, penetrations, half, background, held_out, figures, doubts)


def require_ball(ball_diameter: float, sensor: SensorModel) -> None:
    """Require that a ball is no wider than the gel that a sensor sees.

    Parameters
    ----------
    ball_diameter : [m]
    sensor
        Full size.

    Raises
    ------
    InputError
        It is wider, or has no positive diameter.
    """
    gel = sensor.width * sensor.pixel_size
    if not 0 < ball_diameter <= gel:
        raise InputError(
            f"ball of {ball_diameter:g} m diameter: the gel in view is {1e3 * gel:.0f} mm wide, and a larger ball is "
            "hardly curved on it; give the diameter in metres, 0.006 for 6 mm, or take a smaller ball"
        )


def _made_of(background: np.ndarray, sensor: SensorModel, serial: str, ball_diameter: float) -> dict:
    """Return the fields of a calibration that describe its making, except the number of presses."""
    return {
        "serial": serial,
        "ball_diameter": ball_diameter,
        "sensor": sensor.name,
        "pixel_size": sensor.pixel_size,
        "background": background_colours(background),
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }


def penetration_of(press: Press, ball_radius: float, sensor: SensorModel) -> np.ndarray:
    """Return the penetration (H, W) m of the ball in a press, negative outside its contact."""
    contact = press.contact
    return ball_penetration(ball_centre(contact.u, contact.v, contact.radius, ball_radius, sensor), ball_radius, sensor)


def _refined(presses: list[Press], ball_radius: float, sensor: SensorModel) -> list[Press]:
    used = [press for press in presses if not press.problem]
    contacts = refine_contacts([p.change for p in used], [p.contact for p in used], ball_radius, sensor)
    moved = {}
    for press, contact in zip(used, contacts, strict=True):
        problem = ""
        if contact.explained < _LEAST_EXPLAINED:
            problem = f"unlike the other presses (their light explains {100 * contact.explained:.0f} % of it)"
        elif visible_fraction(contact, sensor) < _LEAST_VISIBLE:
            problem = "cut off at the edge of the view"
        moved[press.name] = dataclasses.replace(press, contact=contact, problem=problem)
    return [moved.get(press.name, press) for press in presses]


def _once_each(presses: list[Press], sensor: SensorModel) -> list[Press]:
    """Return the presses, with a problem set for those that are an earlier press, saved again."""
    judged: list[Press] = []
    for press in presses:
        if not press.problem and any(_repeats(press, other, sensor) for other in judged if not other.problem):
            press = dataclasses.replace(press, problem="there was this very press already; press somewhere else")
        judged.append(press)
    return judged


def _repeats(press: Press, other: Press, sensor: SensorModel) -> bool:
    one, two = press.contact, other.contact
    near = one.distance(two) * sensor.pixel_size < _SAME_POSITION
    return near and abs(one.radius / two.radius - 1) < _SAME_RADIUS


def _require_enough(presses: list[Press], given: bool) -> None:
    """Raise InputError if too few presses are usable; given: true if the no-contact image is not made from them."""
    usable = sum(not press.problem for press in presses)
    if usable >= FEWEST:
        return
    said = f"{usable} of {len(presses)} presses can be used, {FEWEST} are needed. {reasons(presses)}"
    if given and 2 * usable < len(presses):
        said += "; or the no-contact image is of another time or place: capture it again"
    raise InputError(said)


def _require_spread(presses: list[Press], sensor: SensorModel) -> None:
    """Raise InputError if all presses are in one corner: depth elsewhere would be worse than without calibration."""
    centres = np.array([(press.contact.u, press.contact.v) for press in presses if not press.problem])
    spanned = np.ptp(centres, axis=0) / (sensor.width, sensor.height)
    if spanned.prod() < _LEAST_SPREAD:
        raise InputError(
            f"the presses span {100 * spanned[0]:.0f} % of the gel's width and {100 * spanned[1]:.0f} % of its height, "
            "and the light elsewhere is unknown; press all over the gel, near its corners too"
        )


def _require_one_ball(presses: list[Press], ball_diameter: float) -> None:
    radius = 0.5 * ball_diameter
    used = [press for press in presses if not press.problem]
    widest = float(np.median([press.contact.radius for press in used])) / radius
    if widest > _WIDEST_CONTACT:
        raise InputError(f"the contacts are too wide for a ball of {1e3 * ball_diameter:g} mm; give its true diameter")
