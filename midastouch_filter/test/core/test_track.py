import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.motion_model import Odometry
from midastouch_filter.core.track import Track

FIRST = np.eye(4)[None]
BOTH = np.stack([np.eye(4), se3.translation([0, 0.05, 0])])
TWO = np.stack([np.eye(4)] * 2)


@pytest.fixture
def track():
    """Keyframes 10 mm apart."""
    return Track(0.01)


def go(track, *metres, in_contact=True, turn=0.0):
    for x in metres:
        track.moved(Odometry.from_matrix(se3.exp([x, 0, 0, 0, 0, turn])), in_contact)


def test_a_keyframe_is_due_at_once_and_then_after_the_spacing(track):
    assert track.is_due(FIRST)
    track.keep(FIRST)
    go(track, 4e-3, 4e-3)
    assert not track.is_due(FIRST)
    go(track, 4e-3)
    assert track.is_due(FIRST)


def test_a_touch_is_due_after_a_turn_or_with_a_further_finger(track):
    track.keep(FIRST)
    go(track, 0.0, turn=0.9)
    assert not track.is_due(FIRST)
    assert track.is_due(TWO)
    go(track, 0.0, turn=0.2)
    assert track.is_due(FIRST)


def test_a_touch_counts_by_its_distance_to_all_earlier_ones(track):
    weights = []
    for x in (0.0, 5e-3, 0.03, -0.025, -5e-3):
        go(track, x)
        weights.extend(track.keep(FIRST))
    np.testing.assert_allclose(weights, [1.0, 0.5, 1.0, 0.5, 0.0], atol=1e-9)


def test_each_finger_counts_for_itself(track):
    track.keep(BOTH)
    elsewhere = np.stack([np.eye(4), se3.translation([0, 0.055, 0])])
    np.testing.assert_allclose(track.keep(elsewhere), [0.0, 0.5])


def test_a_finger_that_moves_alone_makes_keyframes(track):
    track.keep(BOTH)
    for y, due in ((0.045, False), (0.035, True)):
        assert track.is_due(np.stack([np.eye(4), se3.translation([0, y, 0])])) == due


def test_before_the_first_touch_nothing_is_lifted(track):
    go(track, 0.05, in_contact=False)
    assert not track.lifted


def test_a_lift_makes_touches_new_and_a_gap_in_a_slide_does_not(track):
    track.keep(FIRST)
    for metres, lifted in ((8e-3, False), (12e-3, True)):
        go(track, metres, in_contact=False)
        assert track.lifted == lifted
        go(track, -metres)
        assert track.keep(FIRST) == (1.0 if lifted else 0.0)
        assert not track.lifted


def test_a_forced_touch_counts_in_full_at_rest(track):
    track.keep(FIRST)
    track.force()
    assert track.is_due(FIRST)
    assert track.keep(FIRST) == 1.0


def test_free_space_is_reported_once_in_the_present_frame(track):
    track.keep(FIRST)
    go(track, 0.01, 0.01, 1e-4, in_contact=False)
    go(track, 0.01)
    np.testing.assert_allclose(track.free_space()[:, 0, 3], [-0.0201, -0.0101])
    assert len(track.free_space()) == 0


def test_many_poses_in_the_air_are_bounded(track):
    go(track, *np.full(500, 0.01), in_contact=False)
    air = track.free_space()
    assert 10 < len(air) < 100
    assert air[-1, 0, 3] == pytest.approx(0.0)


def test_touches_since_the_last_lift_are_in_the_present_frame(track):
    assert len(track.touched) == 0
    track.keep(BOTH)
    go(track, 0.01)
    np.testing.assert_allclose(track.touched[:, :3, 3], [[-0.01, 0, 0], [-0.01, 0.05, 0]], atol=1e-12)
    go(track, 0.02, in_contact=False)
    assert len(track.touched) == 0


def test_motion_that_is_not_known_moves_nothing(track):
    track.keep(FIRST)
    track.moved(None, in_contact=True)
    assert track.odometer == 0.0
    assert not track.is_due(FIRST)
