import numpy as np
import pytest

from midastouch_benchmark.perception import held_out_calibrations as module
from midastouch_benchmark.perception.held_out_calibrations import calibrations_of, held_out_calibrations
from midastouch_bringup.datasets.ball_presses import BallPresses
from midastouch_common.errors import InputError


@pytest.fixture
def presses():
    free = np.zeros((320, 240, 3), np.uint8)
    return BallPresses({f"{i}.png": free for i in range(14)}, free, None)


@pytest.fixture
def made_of(monkeypatch):
    """Calibrations that are the names of the presses they were made of."""

    class Made:
        def __init__(self, names):
            self.calibration = names

    monkeypatch.setattr(module, "calibrate", lambda images, *_, **__: Made(frozenset(images)))


def test_no_press_is_judged_with_a_calibration_that_has_seen_it(presses, made_of):
    found = held_out_calibrations(presses, 6e-3, None, 10, np.random.default_rng(0))
    assert set(found) == set(presses.images)
    assert all(len(names) == 10 and name not in names for name, names in found.items())


def test_seeds_repeat(presses, made_of):
    settings = {"calibrated_with": 8, "seed": 3, "ball_diameter": 6e-3}
    assert calibrations_of(settings, presses, None) == calibrations_of(settings, presses, None)
    assert calibrations_of({**settings, "seed": 4}, presses, None) != calibrations_of(settings, presses, None)
    assert calibrations_of({"calibration": None, "calibrated_with": None}, presses, None) is None


@pytest.mark.parametrize("n", [4, 14])
def test_too_few_presses_are_refused(presses, n):
    with pytest.raises(InputError, match="give from 5 to 13"):
        held_out_calibrations(presses, 6e-3, None, n, np.random.default_rng(0))
