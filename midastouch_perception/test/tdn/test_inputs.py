import numpy as np
import pytest

from midastouch_perception.tdn.inputs import ContactLight


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
    share = contact / 100
    light = ContactLight(lamps * background, "relative")
    bright = lamps * background > 30
    seen = light.difference(lamps * background * (1 + share))
    np.testing.assert_allclose(seen[bright], contact[bright], atol=1e-3)
    assert (np.abs(seen) <= np.abs(contact) + 1e-3).all(), "what is dark is not enlarged"


@pytest.mark.parametrize("kind", ["additive", "relative"])
def test_a_black_image_is_finite(kind):
    background, _ = scene()
    assert np.isfinite(ContactLight(background, kind).difference(np.zeros_like(background))).all()
    assert np.isfinite(ContactLight(np.zeros_like(background), kind).difference(background)).all()
