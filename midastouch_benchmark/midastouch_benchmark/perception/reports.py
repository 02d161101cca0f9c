"""Reports of `midastouch evaluate-perception`: each takes the command's options and returns the content of its JSON."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.contact import TOUCHED
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn
from midastouch_perception.tdn import DepthNet, load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, measured_sensors
from midastouch_simulation.optics import ColourTable
from midastouch_simulation.randomisation import RandomisationRange
from midastouch_simulation.training.setting import load_backgrounds
from midastouch_tools.datasets import load_sequence
from midastouch_tools.datasets.ball_presses import BallPresses, load_ball_presses
from midastouch_tools.machine import machine_info
from midastouch_tools.progress import progress_bar

from ..speed.timing import CallTimer
from ..trials.object_sets import chosen_meshes
from ..trials.setup import require_same_gel, sensor_of, untouched_of
from .check_quality import (
    TOUCHES,
    CheckQuality,
    causes_named,
    diameter_checks,
    imaginary_sensors,
    layout_quality,
    real_checks,
)
from .press_quality import measure_presses
from .press_truth import FittedBall, calibrations_of, usable_presses, with_truth
from .real_gel_checks import Reading, gels_known, measured_readings, mini_reading, missed_touches, slow_light
from .soft_gel import THICKNESSES, CommandedPresses, SoftGelTouches, SoftSensor

_RECORDS = 12  # of slow light on each calibrated sensor


def tdn(args: argparse.Namespace) -> dict:
    """Judge the depth network on sequences with ground truth; InputError for a sequence without, or another gel's."""
    sequences = [load_sequence(path) for path in args.sequences]
    for sequence in sequences:
        if not sequence.ground_truth_frames:
            raise InputError(f"{sequence.path}: no ground truth (gt_heightmaps); only simulated sequences have it")
    sensor = SensorModel.load(args.sensor or sensor_of(sequences))
    network = load_tdn(args.tdn, sensor, SensorCalibration.load(args.calibration) if args.calibration else None)
    untouched = [untouched_of(sequence, args.background) for sequence in sequences]
    require_same_gel(network, untouched)
    total, results, all_ms = DepthQuality(), [], []
    with progress_bar(total=sum(len(s.ground_truth_frames) for s in sequences), unit="frame") as bar:
        for sequence, free in zip(sequences, untouched, strict=True):
            bar.set_description(sequence.name)
            quality, stopwatch = DepthQuality(), CallTimer()
            network.predict(sequence.image(sequence.ground_truth_frames[0]), free.image)  # warm-up, not timed
            for i in sequence.ground_truth_frames:
                image = sequence.image(i)
                with stopwatch:
                    predicted = network.predict(image, free.image)
                quality.add(predicted, sequence.penetration_truth(i))
                bar.update(1)
            total.merge(quality)
            all_ms += stopwatch.wall_ms
            mean = {"ms_per_frame": float(np.mean(stopwatch.wall_ms)), "background": free.source}
            results.append({"sequence": sequence.name, **quality.result(), **mean})
    return {
        "network": network.network_id,
        "sensor": sensor.name,
        "calibration": args.calibration,
        "machine": machine_info(),
        "sequences": results,
        "summary": {**total.result(), "ms_per_frame": float(np.mean(all_ms))},
    }


def presses(args: argparse.Namespace) -> dict:
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
    known = with_truth(usable, args.ball_diameter, sensor)
    with progress_bar(total=len(usable.images), unit="press") as bar:
        rows, summary = measure_presses(network, known.presses, radius, bar.update, calibrations)
    summary["brightness_mm"] = 1e3 * brightness_effect(network, usable, calibrations)
    checked = {}
    if args.check_labels:
        ball = FittedBall(usable, args.ball_diameter, sensor)
        labelled = usable.only(list(ball.presses.images))
        checked = {
            "labels": measure_presses(ball, labelled, radius)[1],  # type: ignore[arg-type] # it replaces a network
            "against_fit": measure_presses(network, ball.presses, radius, calibrations=calibrations)[1],
        }
    return {
        "folder": str(Path(args.folder).resolve()),
        **settings,
        "px_per_mm": args.px_per_mm,
        "tdn": args.tdn,
        "network": network.network_id,
        "sensor": args.sensor,
        "model_calibration": SensorCalibration.default(sensor) is not None,
        "machine": machine_info(),
        "unusable": _listed(unusable),
        "unfitted": _listed(known.unfitted),
        "depth_problem": known.problem,
        "presses": rows,
        "summary": summary,
        **checked,
    }


def _listed(problems: dict[str, str]) -> list[dict[str, str]]:
    return [{"image": name, "problem": problem} for name, problem in problems.items()]


def gel(args: argparse.Namespace) -> dict:
    """Measure touches and presses of known depth on soft gel."""
    meshes = chosen_meshes(args.meshes, args.objects, "out/benchmark")
    sensor = SensorModel.load("digit_real")
    tcn, sensors = load_tcn("fast", sensor), []
    for number, name in enumerate(measured_sensors()):
        optics = MeasuredOptics.load(name)
        for thickness in THICKNESSES:
            sensors.append(SoftSensor(optics, sensor, thickness))
            sensors.append(SoftSensor(optics, sensor, thickness, np.random.default_rng([args.seed, number])))
    commanded = CommandedPresses(sensor, args.presses, np.random.default_rng(args.seed))
    pressed = [row for each in sensors for row in commanded.seen_by(each)]
    touches = []
    for mesh in progress_bar(iterable=meshes, total=len(meshes), unit="object"):
        # the seed of an object does not depend on which others are measured
        rng = np.random.default_rng([args.seed, int(mesh.sha256[:8], 16)])
        touched = SoftGelTouches(mesh, sensor, tcn, args.touches, rng)
        touches += [row for each in sensors for row in touched.seen_by(each)]
    return {"seed": args.seed, "machine": machine_info(), "touches": touches, "presses": pressed}


def checks(args: argparse.Namespace) -> dict:
    """Measure how often the checks on tactile images are wrong, on imaginary, measured and real sensors."""
    sensor, rng = SensorModel.load(args.sensor), np.random.default_rng(args.seed)
    pressed = {Path(folder).name: load_ball_presses(folder) for folder in args.presses}
    backgrounds = np.concatenate(load_backgrounds(args.backgrounds, sensor.height, sensor.width))
    ranges = RandomisationRange(colour_table=ColourTable.load(args.colour_table) if args.colour_table else None)
    network = load_tdn(args.tdn, sensor)
    quality = CheckQuality(network)
    sensors = imaginary_sensors(args.sensors + 1, sensor, backgrounds, ranges, rng)
    for own, other in progress_bar(iterable=itertools.pairwise(sensors), total=args.sensors, unit="sensor"):
        quality.add(own, other)
    real = SensorModel.load("digit_real")
    network_of_real = load_tdn(args.tdn, real)
    large = np.concatenate(load_backgrounds(args.backgrounds, real.height, real.width))
    digits = [Reading("DIGIT", network_of_real, background) for background in large]
    measured = measured_readings(args.tdn, rng)
    calibrated = [each for each in measured if each.tdn.calibration_in_use] + [mini_reading(args.tdn)]
    return {
        "network": network.network_id,
        "sensor": args.sensor,
        "sensors": args.sensors,
        "no_contact_images": len(backgrounds),
        "seed": args.seed,
        "machine": machine_info(),
        "fit_check": quality.fit(),
        "no_contact_image": layout_quality(backgrounds),
        "cause_named": causes_named(backgrounds),
        "capture": quality.capture(),
        "contact": quality.contact(),
        "light_touches": missed_touches(measured, TOUCHES * args.sensors, rng),
        "real_sensors": {name: real_checks(network_of_real, each, rng) for name, each in pressed.items()},
        "gels": gels_known(network_of_real, pressed, large, real, rng),
        "slow_light": slow_light(digits, 1, rng) + slow_light(calibrated, _RECORDS, rng),
        "ball_diameter": diameter_checks(real, large, args.sensors, rng),
    }


class DepthQuality:
    """Accumulator of errors over the frames of a sequence, at the truth's resolution."""

    def __init__(self) -> None:
        self.frames = 0
        self._squares, self._pixels = 0.0, 0
        self._contact_squares, self._contact_pixels = 0.0, 0
        self._both, self._either = 0, 0

    def add(self, predicted: np.ndarray, truth: np.ndarray) -> None:
        """Add one frame: penetration maps [m]; the prediction (h, w) is enlarged bilinearly to the truth's (H, W)."""
        enlarged = cv2.resize(predicted, truth.shape[::-1], interpolation=cv2.INTER_LINEAR)
        squares = (enlarged.astype(float) - truth) ** 2
        contact, claimed = truth >= TOUCHED, enlarged >= TOUCHED
        self.frames += 1
        self._squares += squares.sum()
        self._pixels += squares.size
        self._contact_squares += squares[contact].sum()
        self._contact_pixels += int(contact.sum())
        self._both += int((contact & claimed).sum())
        self._either += int((contact | claimed).sum())

    def result(self) -> dict[str, float]:
        """Return RMSE [mm] over all pixels and over the truly touched ones, and IoU of the contact over all frames."""
        return {
            "frames": self.frames,
            "rmse_mm": 1e3 * _root_mean(self._squares, self._pixels),
            "contact_rmse_mm": 1e3 * _root_mean(self._contact_squares, self._contact_pixels),
            "contact_iou": self._both / self._either if self._either else float("nan"),
        }

    def merge(self, other: DepthQuality) -> None:
        """Add another sequence's pixels to this one's."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)


def _root_mean(total: float, count: int) -> float:
    return float(np.sqrt(total / count)) if count else float("nan")


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
