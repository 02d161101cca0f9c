"""Two kinds of sensors and the touch of a ball, for tests of several packages."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel


@pytest.fixture(scope="session")
def sensor() -> SensorModel:
    return SensorModel.load("digit_tacto")


@pytest.fixture(scope="session")
def real():
    """At half resolution."""
    return SensorModel.load("digit_real").scaled(0.5)


@pytest.fixture(scope="session")
def cap(real):
    """Penetration map (160, 120) m of a ball of 4 mm radius that touches in a circle of 2 mm."""
    return np.maximum(ball_penetration(ball_centre(60, 80, 2e-3, 4e-3, real), 4e-3, real), 0)
