"""Meshes, networks and a real sensor shared by the perception tests."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_perception.sensor_calibration.calibration import SensorCalibration, background_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import TactileCodeNet, load_tcn, minkloc3d_network
from midastouch_simulation.simulated_digit import PressedSensor


@pytest.fixture(scope="session")
def minkloc_state() -> dict[str, np.ndarray]:
    """Random weights of MinkLoc3D under their official names."""
    return random_state(minkloc3d_network.expected_shapes(), np.random.default_rng(0))


@pytest.fixture(scope="session")
def tcn() -> TactileCodeNet:
    return load_tcn("fast")


@pytest.fixture(scope="session")
def real() -> SensorModel:
    return SensorModel.load("digit_real")


@pytest.fixture(scope="session")
def calibrated(real):
    """Makes calibrations of a sensor, of its coefficients (12, 6, 2) and its no-contact image."""

    def make(coefficients: np.ndarray, background: np.ndarray) -> SensorCalibration:
        colours = background_colours(background)
        return SensorCalibration(
            "D20123", 6e-3, "digit_real", real.pixel_size, coefficients, colours, 10, "2026-11-22T09:00:00+00:00"
        )

    return make


@pytest.fixture(scope="session")
def another_digit(real):
    """Makes imaginary sensors of a seed, on which a ball of 6 mm is pressed."""
    rows, columns = np.mgrid[-1:1:320j, -1:1:240j]
    lamps = np.stack([110 - 30 * columns, 110 + 30 * columns, 100 + 30 * rows], axis=-1).astype(np.uint8)
    return lambda seed: PressedSensor(real, lamps[None], 3e-3, np.random.default_rng(seed))
