from collections import Counter

import numpy as np
import pytest

from midastouch_benchmark.perception.depth_quality import depth_figures, depth_sums
from midastouch_benchmark.perception.press_truth import brightness_effect
from midastouch_tools.datasets.ball_presses import BallPresses


def halves(left: float, right: float) -> np.ndarray:
    """(320, 240) map [m], constant on either side."""
    out = np.full((320, 240), left, np.float32)
    out[:, 120:] = right
    return out


def figures(*pairs: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    """Figures over frames, each a prediction and the truth."""
    sums = Counter()
    for predicted, truth in pairs:
        sums.update(depth_sums(predicted, truth))
    return depth_figures(sums)


def test_errors_over_all_pixels_and_over_the_touched_ones():
    result = figures((halves(0.0, 0.8e-3), halves(0.0, 1.0e-3)))
    assert result["rmse_mm"] == pytest.approx(0.2 / np.sqrt(2))
    assert result["contact_rmse_mm"] == pytest.approx(0.2)
    assert result["contact_iou"] == 1.0


def test_iou_counts_what_is_claimed_and_what_is_missed():
    assert figures((halves(1e-3, 1e-3), halves(0.0, 1e-3)))["contact_iou"] == pytest.approx(0.5)


def test_small_predictions_are_enlarged_bilinearly():
    ramp = np.linspace(0, 1e-3, 120, dtype=np.float32)[None].repeat(160, axis=0)
    truth = np.linspace(0, 1e-3, 240, dtype=np.float32)[None].repeat(320, axis=0)
    assert figures((ramp, truth))["rmse_mm"] < 0.01


def test_frames_pool_pixels_not_means():
    touched = halves(0, 1e-3), halves(0, 0.9e-3)
    free = halves(0, 0), halves(0, 0)
    result = figures(touched, free, free)
    assert result["frames"] == 3
    assert result["rmse_mm"] == pytest.approx(0.1 / np.sqrt(6))
    assert result["contact_rmse_mm"] == pytest.approx(0.1)


def test_no_contact_anywhere_has_no_iou():
    assert np.isnan(figures((halves(0, 0), halves(0, 0)))["contact_iou"])


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


def test_what_follows_the_light_is_told_from_what_takes_it_off():
    image = FREE.copy()
    image[100:200, 80:160] = 150
    presses = BallPresses({"0.png": image, "1.png": image}, FREE, None)
    untouched, touched = 10.0, 15.0
    fraction = 100 * 80 / (320 * 240)
    expected = 1e-5 * np.sqrt((1 - fraction) * untouched**2 + fraction * touched**2)
    assert brightness_effect(FakeTdn(gain=False), presses) == pytest.approx(expected)
    assert brightness_effect(FakeTdn(gain=True), presses) < 1e-9
