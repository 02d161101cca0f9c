import numpy as np
import pytest

from midastouch_perception.errors import InputError
from midastouch_perception.tdn import estimate_background


def test_contacts_that_move_on_vanish():
    rng = np.random.default_rng(0)
    background = rng.integers(50, 200, (320, 240, 3)).astype(np.uint8)
    frames = []
    for i in range(15):
        frame = background.copy()
        frame[20 * i : 20 * i + 60] = 255
        frames.append(frame)
    np.testing.assert_array_equal(estimate_background(frames), background)


def test_nothing_to_estimate_from():
    with pytest.raises(InputError, match="no frames"):
        estimate_background([])


def test_frames_of_different_sensors():
    with pytest.raises(InputError, match="different size"):
        estimate_background([np.zeros((320, 240, 3), np.uint8), np.zeros((240, 320, 3), np.uint8)])
