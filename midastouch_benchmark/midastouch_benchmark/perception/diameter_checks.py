"""How surely a wrong diameter of the ball is told, on imaginary sensors, and how often a right one is doubted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from midastouch_perception.sensor_calibration.network_checks import diameter_doubt, measured_radius
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.simulated_digit import PressedSensor

FACTORS = (0.5, 1 / 1.4, 1.0, 1.4, 2.0)
"""Diameter given over the true one."""
RADII = 2e-3, 5e-3
"""Of the balls, from and to [m]."""
_PRESSES = 8


def diameter_checks(sensor: SensorModel, backgrounds: np.ndarray, n: int, rng: np.random.Generator) -> dict:
    """On `n` sensors with `backgrounds` (B, H, W, 3) uint8 RGB, full size: felt over true radius (median), standard
    deviation of its logarithm; by factor, share of doubts, which are refused unless said to be right."""
    ratios, outcomes = [], {factor: [] for factor in FACTORS}
    for radius, felt in felt_balls(sensor, backgrounds, n, rng):
        if felt is not None:
            ratios.append(felt / radius)
        for factor, seen in outcomes.items():
            seen.append(bool(diameter_doubt(felt, 2 * radius * factor)))
    return {
        "sensors": n,
        "felt_over_true": float(np.median(ratios)),
        "spread": float(np.std(np.log(ratios))),
        "given": [{"factor": factor, "doubted": float(np.mean(seen))} for factor, seen in outcomes.items()],
    }


def felt_balls(
    sensor: SensorModel, backgrounds: np.ndarray, n: int, rng: np.random.Generator
) -> Iterator[tuple[float, float | None]]:
    """Radius [m] of the ball on each of `n` sensors as above, and the one felt, None if nothing is."""
    for _ in range(n):
        radius = rng.uniform(*RADII)
        digit = PressedSensor(sensor, backgrounds, radius, rng)
        yield radius, measured_radius(list(digit.presses(_PRESSES).values()), digit.background, sensor)
