import numpy as np
import pytest

from midastouch_simulation.engine import MotionWatch, Shutter

PERIOD = 20_000_000  # ns, at 50 images a second
MS = 1_000_000  # ns


@pytest.fixture
def shutter():
    shutter = Shutter(50)
    assert shutter.due(7 * PERIOD) == 7 * PERIOD
    return shutter


def test_moments_are_evenly_spaced_and_never_ahead_of_the_engine(shutter):
    taken = [shutter.due(7 * PERIOD + step * 3_000_000) for step in range(100)]
    moments = [moment for moment in taken if moment is not None]
    assert moments == [(8 + i) * PERIOD for i in range(14)]
    assert all(m is None or m <= 7 * PERIOD + i * 3_000_000 for i, m in enumerate(taken))


def test_a_slow_engine_has_images_between_its_states(shutter):
    newest = 10 * PERIOD
    assert [shutter.due(newest) for _ in range(4)] == [8 * PERIOD, 9 * PERIOD, newest, None]


def test_time_that_leaps_is_followed(shutter):
    assert [shutter.due(400 * PERIOD + 5) for _ in range(2)] == [400 * PERIOD, None]
    assert [shutter.due(2 * PERIOD), shutter.due(3 * PERIOD)] == [2 * PERIOD, 3 * PERIOD]
    shutter.restart()
    assert shutter.due(9 * PERIOD + 1) == 9 * PERIOD + 1


def at(x: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def test_what_never_changes_is_not_silent_and_a_restart_no_leap():
    watch = MotionWatch(timeout=0.5)
    assert [watch.silence(None, now=t) for t in (0.0, 10.0, 1000.0)] == [0, 0, 0]
    watch.jump(500 * MS, at(0.0))
    watch.restart()
    assert watch.jump(17 * MS, at(0.5)) == ""
    assert watch.jump(16 * MS, at(0.0)) == ""  # it ran back: no time has passed in which to move
