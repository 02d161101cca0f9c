"""Errors of the depth network on sequences with ground truth."""

from __future__ import annotations

import argparse
from collections import Counter

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.contact import TOUCHED
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_tools.datasets import load_sequence
from midastouch_tools.progress import progress_bar

from ..speed.timing import CallTimer
from ..trials.setup import require_same_gel, sensor_of, untouched_of


def report(args: argparse.Namespace) -> dict:
    """Judge the depth network on sequences with ground truth; InputError for a sequence without, or another gel's."""
    sequences = [load_sequence(path) for path in args.sequences]
    for sequence in sequences:
        if not sequence.ground_truth_frames:
            raise InputError(f"{sequence.path}: no ground truth (gt_heightmaps); only simulated sequences have it")
    sensor = SensorModel.load(args.sensor or sensor_of(sequences))
    network = load_tdn(args.tdn, sensor, SensorCalibration.load(args.calibration) if args.calibration else None)
    untouched = [untouched_of(sequence, args.background) for sequence in sequences]
    require_same_gel(network, untouched)
    total: Counter[str] = Counter()
    results, all_ms = [], []
    with progress_bar(total=sum(len(s.ground_truth_frames) for s in sequences), unit="frame") as bar:
        for sequence, free in zip(sequences, untouched, strict=True):
            bar.set_description(sequence.name)
            sums: Counter[str] = Counter()
            stopwatch = CallTimer()
            network.predict(sequence.image(sequence.ground_truth_frames[0]), free.image)  # warm-up, not timed
            for i in sequence.ground_truth_frames:
                image = sequence.image(i)
                with stopwatch:
                    predicted = network.predict(image, free.image)
                sums.update(depth_sums(predicted, sequence.penetration_truth(i)))
                bar.update(1)
            total.update(sums)
            all_ms += stopwatch.wall_ms
            mean = {"ms_per_frame": float(np.mean(stopwatch.wall_ms)), "background": free.source}
            results.append({"sequence": sequence.name, **depth_figures(sums), **mean})
    return {
        "network": network.network_id,
        "sensor": sensor.name,
        "calibration": args.calibration,
        "sequences": results,
        "summary": {**depth_figures(total), "ms_per_frame": float(np.mean(all_ms))},
    }


def depth_sums(predicted: np.ndarray, truth: np.ndarray) -> Counter:
    """Return sums over the pixels of a frame, which `depth_figures` takes, at the truth's resolution; maps are in m.

    The prediction (h, w) is enlarged bilinearly to the truth's (H, W).
    """
    enlarged = cv2.resize(predicted, truth.shape[::-1], interpolation=cv2.INTER_LINEAR)
    squares = (enlarged.astype(float) - truth) ** 2
    contact, claimed = truth >= TOUCHED, enlarged >= TOUCHED
    return Counter(
        frames=1,
        squares=squares.sum(),
        pixels=squares.size,
        contact_squares=squares[contact].sum(),
        contact_pixels=int(contact.sum()),
        both=int((contact & claimed).sum()),
        either=int((contact | claimed).sum()),
    )


def depth_figures(sums: Counter) -> dict[str, float]:
    """Return RMSE [mm] over all pixels and over the truly touched ones, and IoU of the contact, over all frames."""

    def ratio(part: str, whole: str) -> float:
        return float(sums[part] / sums[whole]) if sums[whole] else float("nan")

    return {
        "frames": sums["frames"],
        "rmse_mm": 1e3 * float(np.sqrt(ratio("squares", "pixels"))),
        "contact_rmse_mm": 1e3 * float(np.sqrt(ratio("contact_squares", "contact_pixels"))),
        "contact_iou": ratio("both", "either"),
    }
