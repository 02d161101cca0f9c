"""Truth of presses of a ball: the usable presses, the ball's place in each, and the sensor calibrations.

The ball is known by labels. Without labels the images give it: every press's contact is moved until one light for all
presses explains the images best, as `midastouch calibrate` does; no network and no label takes part. If that fails, it
is taken from the outline that the network measures, by which the network seems several times better than it is.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration import presses as ball_presses
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_calibration.fit import FEWEST, MOST, calibrate
from midastouch_perception.sensor_calibration.presses import Press
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import colour_layout
from midastouch_perception.tdn.inputs import ContactLight, reduce_image, without_drift
from midastouch_tools.datasets.ball_presses import BACKGROUND, IMAGES, BallPresses

from .press_quality import visible_contact


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

    def depth(self, difference: np.ndarray, penetration: np.ndarray) -> float:
        """Return the deepest penetration [m]; the sinking of the gel around the ball is not known."""
        return float(penetration.max())


def _circle(press: Press, sensor: SensorModel) -> tuple[float, float, float]:
    """Return column, row and radius of a press's contact in pixels of the full image."""
    contact, scale = press.contact, sensor.width / press.change.shape[1]
    # the middle of a pixel of the map lies between pixels of the image
    u, v = (scale * (place + 0.5) - 0.5 for place in (contact.u, contact.v))
    return u, v, contact.radius / sensor.pixel_size


@dataclasses.dataclass(frozen=True)
class KnownPresses:
    """Presses and their truth. presses: with a circle for each press whose labels or images give one; unfitted: reasons
    by file name why the images give none; problem: why depth cannot be judged, empty if it can.
    """

    presses: BallPresses
    unfitted: dict[str, str]
    problem: str = ""


def with_truth(presses: BallPresses, ball_diameter: float, sensor: SensorModel) -> KnownPresses:
    """Return the presses with the best circles available; ball_diameter: m; sensor: at full size."""
    if presses.circles is not None:
        return KnownPresses(presses, {})
    try:
        ball = FittedBall(presses, ball_diameter, sensor)
    except InputError as error:
        return KnownPresses(presses, {}, str(error))
    known = dataclasses.replace(presses, circles=ball.presses.circles, circles_from=ball.presses.circles_from)
    return KnownPresses(known, ball.unfitted)


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
