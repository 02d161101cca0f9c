"""Make the calibration that comes with a sensor model, from presses of balls on one sensor of the kind.

.venv/bin/python -m midastouch_benchmark.fits.default_calibration --sensor gelsight_mini \
    --presses ../shared/data/gelsight_mini/presses_6310=0.00631 ../shared/data/gelsight_mini/presses_9500=0.0095 \
    --out midastouch_perception/midastouch_perception/sensor_calibration/defaults/gelsight_mini.npz
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from midastouch_perception.sensor_calibration.fit import calibrate, fitted
from midastouch_perception.sensor_model import SensorModel
from midastouch_tools.datasets.ball_presses import load_ball_presses


def main() -> None:
    """Write the calibration."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--sensor", required=True, help="name of the sensor model")
    parser.add_argument("--presses", nargs="+", required=True, metavar="DIR=METRES", help="diameter of each one's ball")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    sensor = SensorModel.load(args.sensor)
    changes, penetrations, results = [], [], []
    for each in args.presses:
        folder, _, diameter = each.rpartition("=")
        presses = load_ball_presses(folder)
        results.append(calibrate(presses.images, presses.background, float(diameter), sensor, diameter_is_right=True))
        changes += [press.change for press in results[-1].presses]
        penetrations += results[-1].penetrations
    first = results[0].calibration
    made = {
        field.name: getattr(first, field.name)
        for field in dataclasses.fields(first)
        if field.name not in ("coefficients", "presses")
    }
    calibration, _ = fitted(changes, penetrations, sensor.for_maps.pixel_size, made)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    calibration.save(args.out)
    print(f"{args.out}: {calibration.presses} presses")


if __name__ == "__main__":
    main()
