import numpy as np
import pytest

from midastouch_benchmark.perception.brightness import brightness_effect
from midastouch_bringup.datasets.ball_presses import BallPresses

FREE = np.full((320, 240, 3), 100, np.uint8)


class FakeTdn:
    """Feels 10 um for each grey level above the background; `gain` takes off what all of an image has in common."""

    def __init__(self, gain):
        self._gain = gain

    def predict(self, image, background):
        image = image.astype(float)
        if self._gain:
            image *= np.median(background) / np.median(image)
        return 1e-5 * (image - background)[..., 0]


@pytest.fixture(scope="module")
def presses():
    image = FREE.copy()
    image[100:200, 80:160] = 150
    return BallPresses({"0.png": image, "1.png": image}, FREE, None)


def test_what_follows_the_light_is_told(presses):
    untouched, touched = 10.0, 15.0
    share = 100 * 80 / (320 * 240)
    expected = 1e-5 * np.sqrt((1 - share) * untouched**2 + share * touched**2)
    assert brightness_effect(FakeTdn(gain=False), presses) == pytest.approx(expected)


def test_what_takes_off_the_light_is_steady(presses):
    assert brightness_effect(FakeTdn(gain=True), presses) < 1e-9
