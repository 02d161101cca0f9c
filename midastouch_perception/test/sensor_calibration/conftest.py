import pytest

from midastouch_perception.sensor_model import SensorModel


@pytest.fixture(scope="session")
def real():
    return SensorModel.load("digit_real")


@pytest.fixture
def digit(another_digit):
    """One that nothing has pressed yet: its noise goes on with every image."""
    return another_digit(6)
