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
    light = ContactLight(background)
    seen = light.difference((background + contact) * np.float32(gain))
    np.testing.assert_allclose(seen, contact, atol=1e-3)


def test_a_black_image_is_finite():
    background, _ = scene()
    assert np.isfinite(ContactLight(background).difference(np.zeros_like(background))).all()
    assert np.isfinite(ContactLight(np.zeros_like(background)).difference(background)).all()
