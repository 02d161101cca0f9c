"""Report `presses`: the usable presses of a ball, its place in each, and the sensor calibrations that judge them.

The ball is known by labels. Without labels the images give it: every press's contact is moved until one light for all
presses explains the images best, as `midastouch calibrate` does; no network and no label takes part. If that fails, it
is taken from the outline that the network measures, by which the network seems several times better than it is.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration import presses as ball_presses
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_calibration.fit import FEWEST, MOST, calibrate
from midastouch_perception.sensor_calibration.presses import Press
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet, colour_layout, load_tdn
from midastouch_perception.tdn.inputs import ContactLight, reduce_image, without_drift
from midastouch_tools.datasets.ball_presses import BACKGROUND, IMAGES, BallPresses, load_ball_presses

from .press_quality import measure_presses, visible_contact


class FittedBall:
    """Replacement of `DepthNet` that knows the ball: it returns the ball's cap at the place that the images give.

    Args: presses; ball_diameter: m; sensor: at full size. Raises InputError as `calibrate`. Attributes: sensor: at the
    map's resolution; presses: those that could be fitted, with these circles in place of the labels; unfitted: reasons
    by file name why the others could not be fitted.
    """

    def __init__(self, presses: BallPresses, ball_diameter: float, sensor: SensorModel):
        names = list(presses.images)
        # the fit takes no more, and more would not improve it
        chosen = [names[i] for i in np.unique(np.linspace(0, len(names) - 1, MOST).round().astype(int))]
        images = {name: presses.images[name] for name in chosen}
        result = calibrate(images, presses.background, ball_diameter, sensor, diameter_is_right=True)
        self.sensor = result.sensor
        pairs = zip(result.presses, result.penetrations, strict=True)
        fitted = {press.name: (press, penetration) for press, penetration in pairs if penetration is not None}
        self._fitted = {presses.images[name].tobytes(): each for name, each in fitted.items()}
        circles = {name: _circle(press, sensor) for name, (press, _) in fitted.items()}
        self.presses = dataclasses.replace(presses.only(list(fitted)), circles=circles, circles_from=IMAGES)
        problems = {press.name: press.problem for press in result.presses}
        beyond = f"not among the {MOST} that the ball was fitted to"
        self.unfitted = {name: problems.get(name, beyond) for name in names if name not in fitted}

    def difference(self, image: np.ndarray, background: np.ndarray) -> np.ndarray:
        """Return the press's change (H, W, 3) grey levels."""
        return self._fitted[image.tobytes()][0].change

    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray) -> np.ndarray:
        """Return the penetration (H, W) m of the ball."""
        return np.maximum(self._fitted[image.tobytes()][1], 0)


def _circle(press: Press, sensor: SensorModel) -> tuple[float, float, float]:
    """Return column, row and radius of a press's contact in pixels of the full image."""
    contact, scale = press.contact, sensor.width / press.change.shape[1]
    # the middle of a pixel of the map lies between pixels of the image
    u, v = (scale * (place + 0.5) - 0.5 for place in (contact.u, contact.v))
    return u, v, contact.radius / sensor.pixel_size


def with_truth(
    presses: BallPresses, ball_diameter: float, sensor: SensorModel
) -> tuple[BallPresses, dict[str, str], str]:
    """Return the presses, with a circle for each whose labels or images give one; reasons by file name why the images
    give none; and why depth cannot be judged, empty if it can. ball_diameter: m; sensor: at full size."""
    if presses.circles is not None:
        return presses, {}, ""
    try:
        ball = FittedBall(presses, ball_diameter, sensor)
    except InputError as error:
        return presses, {}, str(error)
    known = dataclasses.replace(presses, circles=ball.presses.circles, circles_from=ball.presses.circles_from)
    return known, ball.unfitted, ""


def usable_presses(presses: BallPresses, sensor: SensorModel) -> tuple[BallPresses, dict[str, str]]:
    """Return the presses that show something on this sensor, and by file name the reasons why the others do not.

    sensor: at full size. Repeated images are not used. Raises InputError if the no-contact image shows nothing,
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
        # a turned image differs everywhere, too, but its turn is the better explanation
        or colour_layout.turned_since(image, background)
        or ball_presses.sensor_mismatch(image, seen)
        or ("" if visible_contact(without_drift(seen), sensor.for_maps).any() else "nothing touches the gel")
    )


def calibrations_of(settings: dict, presses: BallPresses, sensor: SensorModel) -> dict[str, SensorCalibration] | None:
    """Return the calibration by which each press is judged, by file name; None if the settings have none.

    settings: `calibration`, a file, `calibrated_with`, a number of presses, `seed` and `ball_diameter` of a result;
    sensor: at full size. Raises InputError if a calibration cannot be read or made, or is another gel's.
    """
    if settings.get("calibration"):
        given = SensorCalibration.load(settings["calibration"])
        given.check_sensor(sensor)
        if problem := given.background_problem(presses.background):
            raise InputError(f"{settings['calibration']}: {problem}")
        return dict.fromkeys(presses.images, given)
    if settings.get("calibrated_with"):
        rng = np.random.default_rng(settings["seed"])
        return held_out_calibrations(presses, settings["ball_diameter"], sensor, settings["calibrated_with"], rng)
    return None


def held_out_calibrations(
    presses: BallPresses, ball_diameter: float, sensor: SensorModel, n: int, rng: np.random.Generator
) -> dict[str, SensorCalibration]:
    """Return, for every press by file name, a calibration from `n` of the others; labels are not used.

    The presses are divided into as few groups, at least two, as leave n outside each; sensor: at full size. Raises
    InputError as `calibrate`, and for too few presses.
    """
    names = list(presses.images)
    if not FEWEST <= n < len(names):
        raise InputError(f"to calibrate with {n} of {len(names)} presses: give from {FEWEST} to {len(names) - 1}")
    groups = max(2, -(-len(names) // (len(names) - n)))
    order = rng.permutation(len(names))
    out: dict[str, SensorCalibration] = {}
    for group in np.array_split(order, groups):
        drawn = rng.choice(np.setdiff1d(order, group), n, replace=False)
        images = {names[i]: presses.images[names[i]] for i in sorted(drawn)}
        made = calibrate(images, presses.background, ball_diameter, sensor, diameter_is_right=True).calibration
        out |= {names[i]: made for i in group}
    return out


def report(args: argparse.Namespace) -> dict:
    """Judge the depth network on presses of a ball, and with --check-labels their labels; InputError for unusable ones,
    missing labels, or another gel's calibration."""
    sensor = SensorModel.load(args.sensor)
    if args.px_per_mm:
        sensor = sensor.at_scale(1e3 * args.px_per_mm)
    usable, unusable = usable_presses(load_ball_presses(args.folder), sensor)
    if args.check_labels and usable.circles is None:
        raise InputError(f"{args.folder}: no circles.csv, so there are no labels to check; leave out --check-labels")
    network, radius = load_tdn(args.tdn, sensor), args.ball_diameter / 2
    settings = {
        "ball_diameter": args.ball_diameter,
        "calibration": args.calibration,
        "calibrated_with": args.calibrate_with,
        "seed": args.seed,
    }
    calibrations = calibrations_of(settings, usable, sensor)
    known, unfitted, problem = with_truth(usable, args.ball_diameter, sensor)
    rows, summary = measure_presses(network, known, radius, calibrations)
    summary["brightness_mm"] = 1e3 * brightness_effect(network, usable, calibrations)
    checked = {}
    if args.check_labels:
        ball = FittedBall(usable, args.ball_diameter, sensor)
        labelled = usable.only(list(ball.presses.images))
        checked = {
            "labels": measure_presses(ball, labelled, radius)[1],  # type: ignore[arg-type] # it replaces a network
            "against_fit": measure_presses(network, ball.presses, radius, calibrations)[1],
        }
    return {
        "folder": str(Path(args.folder).resolve()),
        **settings,
        "px_per_mm": args.px_per_mm,
        "tdn": args.tdn,
        "network": network.network_id,
        "sensor": args.sensor,
        "model_calibration": SensorCalibration.default(sensor) is not None,
        "unusable": _listed(unusable),
        "unfitted": _listed(unfitted),
        "depth_problem": problem,
        "presses": rows,
        "summary": summary,
        **checked,
    }


def _listed(problems: dict[str, str]) -> list[dict[str, str]]:
    return [{"image": name, "problem": problem} for name, problem in problems.items()]


CHANGES = 0.9, 1.1


def brightness_effect(
    network: DepthNet, presses: BallPresses, calibrations: Mapping[str, SensorCalibration] | None = None
) -> float:
    """Return the root mean square over all pixels [m] by which the map of a press changes with its brightness.

    Of each press the larger effect of the two `CHANGES` counts; the result is the median over presses. The no-contact
    image stays as it is; calibrations: of each press, as in `measure_presses`.
    """
    effects = []
    for name, image in presses.images.items():
        if calibrations is not None:
            network.calibration = calibrations[name]
        measured = network.predict(image, presses.background)
        changed = [np.clip(np.rint(factor * image.astype(np.float32)), 0, 255).astype(np.uint8) for factor in CHANGES]
        errors = [network.predict(other, presses.background) - measured for other in changed]
        effects.append(max(float(np.sqrt(np.mean(error**2))) for error in errors))
    return float(np.median(effects))
