import numpy as np
import pytest

from midastouch_benchmark.perception.reports import DepthQuality, brightness_effect
from midastouch_tools.datasets.ball_presses import BallPresses


def halves(left: float, right: float) -> np.ndarray:
    """(320, 240) map [m], constant on either side."""
    out = np.full((320, 240), left, np.float32)
    out[:, 120:] = right
    return out


def test_errors_over_all_pixels_and_over_the_touched_ones():
    quality = DepthQuality()
    quality.add(halves(0.0, 0.8e-3), halves(0.0, 1.0e-3))
    result = quality.result()
    assert result["rmse_mm"] == pytest.approx(0.2 / np.sqrt(2))
    assert result["contact_rmse_mm"] == pytest.approx(0.2)
    assert result["contact_iou"] == 1.0


def test_iou_counts_what_is_claimed_and_what_is_missed():
    quality = DepthQuality()
    quality.add(halves(1e-3, 1e-3), halves(0.0, 1e-3))
    assert quality.result()["contact_iou"] == pytest.approx(0.5)


def test_small_predictions_are_enlarged_bilinearly():
    ramp = np.linspace(0, 1e-3, 120, dtype=np.float32)[None].repeat(160, axis=0)
    quality = DepthQuality()
    quality.add(ramp, np.linspace(0, 1e-3, 240, dtype=np.float32)[None].repeat(320, axis=0))
    assert quality.result()["rmse_mm"] < 0.01


def test_merging_pools_pixels_not_means():
    one, two, both = DepthQuality(), DepthQuality(), DepthQuality()
    for quality in (one, both):
        quality.add(halves(0, 1e-3), halves(0, 0.9e-3))
    for quality in (two, both):
        quality.add(halves(0, 0), halves(0.5e-3, 0))
        quality.add(halves(0, 0), halves(0, 0))
    one.merge(two)
    assert one.result() == both.result()
    assert one.frames == 3


def test_no_contact_anywhere_has_no_iou():
    quality = DepthQuality()
    quality.add(halves(0, 0), halves(0, 0))
    assert np.isnan(quality.result()["contact_iou"])


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
    fraction = 100 * 80 / (320 * 240)
    expected = 1e-5 * np.sqrt((1 - fraction) * untouched**2 + fraction * touched**2)
    assert brightness_effect(FakeTdn(gain=False), presses) == pytest.approx(expected)


def test_what_takes_off_the_light_is_steady(presses):
    assert brightness_effect(FakeTdn(gain=True), presses) < 1e-9
