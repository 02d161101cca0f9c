import numpy as np
import pytest

from midastouch_perception.simulation.motion_watch import MotionWatch, too_deep

MS = 1_000_000  # ns


def at(x: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


@pytest.fixture
def watch():
    return MotionWatch(patience=0.5)


def test_silence_counts_from_the_last_change_and_only_beyond_the_patience(watch):
    assert watch.silence(10, now=100.0) == 0
    assert watch.silence(10, now=100.4) == 0
    assert watch.silence(10, now=103.0) == pytest.approx(3.0)
    assert watch.silence(11, now=103.1) == 0


def test_what_never_changes_is_not_silent(watch):
    assert [watch.silence(None, now=t) for t in (0.0, 10.0, 1000.0)] == [0, 0, 0]


def test_a_slide_is_motion_and_a_leap_is_not(watch):
    assert watch.jump(0, at(0.0)) == ""
    assert watch.jump(17 * MS, at(0.01)) == ""
    assert "jumped 300 mm within 17 ms" in watch.jump(34 * MS, at(0.31))
    assert watch.jump(51 * MS, at(0.31)) == ""


def test_an_engine_that_began_anew_did_not_leap(watch):
    watch.jump(500 * MS, at(0.0))
    watch.restart()
    assert watch.jump(17 * MS, at(0.5)) == ""
    assert watch.jump(16 * MS, at(0.0)) == ""  # it ran back: no time has passed in which to move


def test_only_what_no_gel_gives_way_to_is_too_deep():
    assert too_deep(0.002) == ""
    assert "12 mm in the gel" in too_deep(0.012)
