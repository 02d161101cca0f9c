import numpy as np
import pytest

from midastouch_perception.tdn.inputs import contact_change


@pytest.fixture
def background():
    rows, columns = np.mgrid[:160, :120]
    return np.stack([60 + columns, 60 + rows, 200 - columns], axis=-1).astype(np.float32)


@pytest.mark.parametrize("gain", [(1, 1, 1), (0.9, 0.9, 0.9), (1.1, 1.1, 1.1), (0.8, 1.0, 1.3)])
def test_the_frame_s_brightness_is_no_change(background, gain):
    """Of each colour on its own; a contact stays what it is."""
    contact = np.zeros_like(background)
    contact[40:90, 30:80] = (25, -15, 8)
    change = contact_change((background + contact) * np.float32(gain), background)
    np.testing.assert_allclose(change, contact, atol=1e-3)


def test_a_black_image_changes_by_the_background(background):
    np.testing.assert_allclose(contact_change(np.zeros_like(background), background), -background)
    assert np.isfinite(contact_change(background, np.zeros_like(background))).all()
