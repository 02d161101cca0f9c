import numpy as np
import pytest

from midastouch_perception.ball_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.randomisation import RandomSensor

RADIUS = 3e-3


@pytest.fixture(scope="session")
def real():
    return SensorModel.load("digit_real")


class ImaginaryDigit:
    """A simulated sensor on which a ball of 6 mm is pressed: full-size uint8 images."""

    def __init__(self, sensor: SensorModel, seed: int):
        self._sensor, self._rng = sensor, np.random.default_rng(seed)
        rows, columns = np.mgrid[-1 : 1 : sensor.height * 1j, -1 : 1 : sensor.width * 1j]
        lamps = [110 - 30 * columns, 110 + 30 * columns, 100 + 30 * rows]
        self._light = RandomSensor(sensor, np.stack(lamps, axis=-1).astype(np.uint8)[None], self._rng)
        self.background = self.image([])

    def image(self, contacts: list[tuple[float, float, float]]) -> np.ndarray:
        """With balls at columns and rows [px], touching in circles of so many m."""
        caps = [np.zeros((self._sensor.height, self._sensor.width), np.float32)]
        for u, v, contact in contacts:
            caps.append(ball_penetration(ball_centre(u, v, contact, RADIUS, self._sensor), RADIUS, self._sensor))
        height = np.max(caps, axis=0)[None]
        images, _ = self._light.images(height, np.zeros((*height.shape, 3), np.float32), self._rng)
        return np.clip(images[0], 0, 255).astype(np.uint8)

    def presses(self, n: int) -> dict[str, np.ndarray]:
        """Images by name of so many presses, spread over the gel."""
        places = [(u, v) for v in (70, 130, 190, 250) for u in (70, 120, 170)]
        order = self._rng.permutation(len(places))[:n]
        return {f"{i}.png": self.image([(*places[i], self._rng.uniform(1.1e-3, 1.7e-3))]) for i in sorted(order)}


@pytest.fixture(scope="session")
def another_digit():
    """Makes imaginary sensors: sensor model, seed."""
    return ImaginaryDigit


@pytest.fixture(scope="session")
def digit(real):
    return ImaginaryDigit(real, 6)
