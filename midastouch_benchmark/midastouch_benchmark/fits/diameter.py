"""Fit the radius that the depth network measures of a ball, and its spread, on simulated sensors.

.venv/bin/python -m midastouch_benchmark.fits.diameter --backgrounds ../shared/data/digit_backgrounds [--sensors 400]

The results are `RADIUS_RATIO` and `MOST_DIAMETER_FACTOR` of
`midastouch_perception/sensor_calibration/network_checks.py`. No sensor here is among those on which
the report `checks` of `midastouch evaluate-perception` judges them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.training.setting import load_backgrounds

from ..perception.check_quality import measured_balls

DOUBTED = 1 / 8
"""Fraction of right diameters that are doubted."""


def main() -> None:
    """Print both constants."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--backgrounds", type=Path, required=True, help="no-contact images of many DIGITs")
    parser.add_argument("--sensors", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1, help="not that of the report")
    args = parser.parse_args()
    sensor = SensorModel.load("digit_real")
    backgrounds = np.concatenate(load_backgrounds(args.backgrounds, sensor.height, sensor.width))
    balls = measured_balls(sensor, backgrounds, args.sensors, np.random.default_rng(args.seed))
    fractions = np.log([measured / radius for radius, measured in balls if measured is not None])
    usual = np.median(fractions)
    doubt = np.exp(np.quantile(np.abs(fractions - usual), 1 - DOUBTED))
    print(f"{len(fractions)} of {args.sensors} measured")
    print(f"RADIUS_RATIO {np.exp(usual):.3f}, MOST_DIAMETER_FACTOR {doubt:.2f}")


if __name__ == "__main__":
    main()
