"""Calibrations of a sensor for judging presses that they have not seen."""

from __future__ import annotations

import numpy as np

from midastouch_bringup.datasets.ball_presses import BallPresses
from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_calibration.fit import FEWEST, calibrate
from midastouch_perception.sensor_model import SensorModel


def calibrations_of(settings: dict, presses: BallPresses, sensor: SensorModel) -> dict[str, SensorCalibration] | None:
    """The calibration that each press is judged with, by file name; None where there is none.

    settings: `calibration`, a file, `calibrated_with`, a number of presses, and `seed` and `ball_diameter` of an
    `evaluate-presses` result; sensor at full size. Raises InputError if it cannot be read or made, or is another gel's.
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
    """For every press, by file name, a calibration from `n` of the others, whose labels it does not look at.

    The presses are dealt into as few groups, at least two, as leave n outside each; sensor at full size. Raises
    InputError as `calibrate`, and for too few presses.
    """
    names = list(presses.images)
    if not FEWEST <= n < len(names):
        raise InputError(f"to calibrate with {n} of {len(names)} presses: give from {FEWEST} to {len(names) - 1}")
    groups = max(2, -(-len(names) // (len(names) - n)))
    order = rng.permutation(len(names))
    out = {}
    for group in np.array_split(order, groups):
        drawn = rng.choice(np.setdiff1d(order, group), n, replace=False)
        images = {names[i]: presses.images[names[i]] for i in sorted(drawn)}
        made = calibrate(images, presses.background, ball_diameter, sensor, diameter_is_right=True).calibration
        out |= {names[i]: made for i in group}
    return out
