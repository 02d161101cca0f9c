import numpy as np
import pytest

from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.simulated_digit import PressedSensor

RADIUS = 3e-3


@pytest.fixture(scope="session")
def real():
    return SensorModel.load("digit_real")


@pytest.fixture(scope="session")
def another_digit(real):
    """Makes imaginary sensors of a seed, on which a ball of 6 mm is pressed."""
    rows, columns = np.mgrid[-1 : 1 : real.height * 1j, -1 : 1 : real.width * 1j]
    lamps = np.stack([110 - 30 * columns, 110 + 30 * columns, 100 + 30 * rows], axis=-1).astype(np.uint8)
    return lambda seed: PressedSensor(real, lamps[None], RADIUS, np.random.default_rng(seed))


@pytest.fixture
def digit(another_digit):
    """One that nothing has pressed yet: its noise goes on with every image."""
    return another_digit(6)
