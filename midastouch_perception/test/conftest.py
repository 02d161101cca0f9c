"""Meshes, networks and a real sensor shared by the perception tests."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import TactileCodeNet, load_tcn, minkloc3d_network


@pytest.fixture(scope="session")
def sensor() -> SensorModel:
    return SensorModel.load("digit_tacto")


@pytest.fixture(scope="session")
def minkloc_state() -> dict[str, np.ndarray]:
    """Random weights of MinkLoc3D under their official names."""
    return random_state(minkloc3d_network.expected_shapes(), np.random.default_rng(0))


@pytest.fixture(scope="session")
def tcn() -> TactileCodeNet:
    return load_tcn("fast")


@pytest.fixture(scope="session")
def real():
    """At half resolution."""
    return SensorModel.load("digit_real").scaled(0.5)


@pytest.fixture(scope="session")
def cap(real):
    """Penetration map (160, 120) m of a ball of 4 mm radius that touches in a circle of 2 mm."""
    return np.maximum(ball_penetration(ball_centre(60, 80, 2e-3, 4e-3, real), 4e-3, real), 0)
