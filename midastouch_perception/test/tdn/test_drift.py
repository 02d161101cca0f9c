import numpy as np
import pytest

from midastouch_perception.pipeline import DepthStage
from midastouch_perception.tdn import load_tdn
from midastouch_perception.tdn.drift import LightDrift


def test_a_lasting_change_is_learned_and_taken_off():
    rows, columns = np.mgrid[-1:1:160j, -1:1:120j]
    tint = np.stack([4 + 2 * columns, -3 + rows, np.zeros_like(rows)], axis=-1).astype(np.float32)
    drift = LightDrift()
    np.testing.assert_array_equal(drift.correct(tint), tint)
    for _ in range(60):
        drift.learn(tint)
    assert np.abs(drift.correct(tint)).max() < 0.6
    assert np.abs(drift.correct(tint)).mean() < 0.15


def test_a_touch_is_hardly_taken_for_drift():
    """Its bright and dark sides cancel, and it lasts."""
    rows, columns = np.mgrid[:160, :120]
    bump = 20 * np.sin((columns - 60) / 8) * (np.hypot(rows - 80, columns - 60) < 25)
    touch = np.repeat(bump[..., None], 3, axis=-1).astype(np.float32)
    drift = LightDrift()
    for _ in range(100):
        drift.learn(touch)
    left = drift.correct(touch)
    assert np.abs(left).max() > 0.8 * np.abs(touch).max()


def test_another_sensor_is_not_learned():
    drift = LightDrift()
    other = np.full((160, 120, 3), 60, np.float32)
    for _ in range(100):
        drift.learn(other)
    assert drift.correct(other).min() > 40


BACKGROUND = np.full((320, 240, 3), (120, 110, 130), np.uint8)


@pytest.fixture(scope="module")
def tdn():
    return load_tdn("fast")


def warmer(rise: float, rng: np.random.Generator) -> np.ndarray:
    """BACKGROUND with one end brighter by a share `rise`."""
    light = 1 + rise * np.linspace(0, 1, 320)[:, None, None] ** 2
    return np.clip(BACKGROUND * light + rng.normal(0, 1.5, BACKGROUND.shape), 0, 255).astype(np.uint8)


def test_warm_up_is_no_contact(tdn):
    """One end a fifth brighter within 100 frames."""
    rng, stage = np.random.default_rng(0), DepthStage(tdn)
    felt = [stage.process(warmer(2e-3 * i, rng), BACKGROUND)[1].in_contact for i in range(100)]
    assert np.mean(felt) < 0.05
    assert not stage.process(warmer(0.2, rng), BACKGROUND)[1].in_contact


def test_another_background_forgets_what_was_learned(tdn, monkeypatch):
    rng, stage, seen = np.random.default_rng(0), DepthStage(tdn), []

    def predict(image, background, difference):
        seen.append(np.abs(difference).mean())
        return np.zeros(difference.shape[:2], np.float32)

    monkeypatch.setattr(tdn, "predict", predict)
    for _ in range(50):
        stage.process(warmer(0.2, rng), BACKGROUND)
    stage.process(warmer(0.2, rng), BACKGROUND.copy())
    assert seen[-1] > 2 * seen[-2]
