import numpy as np
import pytest

from midastouch_perception.pipeline import DepthStage
from midastouch_perception.tdn import load_tdn
from midastouch_perception.tdn.inputs import ContactLight, LightDrift


def scene(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A background and what a small contact adds to it, both (160, 120, 3) float32."""
    rng = np.random.default_rng(seed)
    background = rng.uniform(40, 160, (160, 120, 3)).astype(np.float32)
    contact = np.zeros_like(background)
    contact[40:80, 30:60] = (30, -20, 10)
    return background, contact


@pytest.mark.parametrize("gain", [(0.9, 0.9, 0.9), (1.1, 1.1, 1.1), (1.1, 1.0, 0.9)])
def test_a_frame_s_own_brightness_is_no_contact(gain):
    background, contact = scene()
    light = ContactLight(background, "additive")
    seen = light.difference((background + contact) * np.float32(gain))
    np.testing.assert_allclose(seen, contact, atol=1e-3)


@pytest.mark.parametrize("lamps", [0.5, 1.0, 1.4])
def test_relative_light_looks_alike_under_any_lamps(lamps):
    background, contact = scene()
    fraction = contact / 100
    light = ContactLight(lamps * background, "relative")
    bright = lamps * background > 30
    seen = light.difference(lamps * background * (1 + fraction))
    np.testing.assert_allclose(seen[bright], contact[bright], atol=1e-3)
    assert (np.abs(seen) <= np.abs(contact) + 1e-3).all(), "what is dark is not enlarged"


@pytest.mark.parametrize("kind", ["additive", "relative"])
def test_a_black_image_is_finite(kind):
    background, _ = scene()
    assert np.isfinite(ContactLight(background, kind).difference(np.zeros_like(background))).all()
    assert np.isfinite(ContactLight(np.zeros_like(background), kind).difference(background)).all()


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
    drift, other = LightDrift(), np.full((160, 120, 3), 60, np.float32)
    for _ in range(100):
        drift.learn(other)
    assert drift.correct(other).min() > 40, "nor is another sensor"


def test_warm_up_is_no_contact(monkeypatch):
    """Brighter in the middle within 200 frames; what is the same all over the image is taken off anyway."""
    rng = np.random.default_rng(0)
    background = np.full((320, 240, 3), (120, 110, 130), np.uint8)
    y, x = np.mgrid[-1:1:320j, -1:1:240j]
    bright = np.exp(-4 * (x**2 + y**2))[..., None]

    def frame(gain):
        return np.clip(background * (1 + gain * bright) + rng.normal(0, 1.5, background.shape), 0, 255).astype(np.uint8)

    tdn, asked = load_tdn("fast"), []
    predict = tdn.predict
    monkeypatch.setattr(tdn, "predict", lambda *given: asked.append(1) or predict(*given))
    stage = DepthStage(tdn)
    in_contact = [stage.process(frame(3e-4 * i), background).in_contact for i in range(200)]
    assert np.mean(in_contact) < 0.05
    assert not asked, "all of it was learned: the network was not asked"
    stage.process(frame(0.06), background.copy())
    assert asked, "another background: what was learned is forgotten"
