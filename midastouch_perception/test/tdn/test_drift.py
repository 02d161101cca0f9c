import numpy as np

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


class Watched:
    """The depth network, with the last difference that it was shown."""

    def __init__(self):
        self._tdn = load_tdn("fast")
        self.sensor, self.difference, self.shown = self._tdn.sensor, self._tdn.difference, None

    def predict(self, image, background, difference):
        self.shown = difference
        return self._tdn.predict(image, background, difference)


def test_warm_up_is_no_contact():
    """Brighter in the middle within 200 frames; what is the same all over the image is taken off anyway."""
    rng = np.random.default_rng(0)
    background = np.full((320, 240, 3), (120, 110, 130), np.uint8)
    y, x = np.mgrid[-1:1:320j, -1:1:240j]
    bright = np.exp(-4 * (x**2 + y**2))[..., None]

    def frame(gain):
        return np.clip(background * (1 + gain * bright) + rng.normal(0, 1.5, background.shape), 0, 255).astype(np.uint8)

    tdn = Watched()
    stage = DepthStage(tdn)
    felt = [stage.process(frame(3e-4 * i), background).in_contact for i in range(200)]
    assert np.mean(felt) < 0.05
    stage.process(frame(0.06), background)
    learned = np.abs(tdn.shown).mean()
    stage.process(frame(0.06), background.copy())
    assert np.abs(tdn.shown).mean() > 1.5 * learned, "another background: what was learned is forgotten"
