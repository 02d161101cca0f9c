import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.pose_hypothesis import ANOTHER, another, distinct, far_from, farther
from midastouch_perception.symmetry.group import Symmetry

HALF_TURN = se3.make(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
SYMMETRY = Symmetry(np.stack([np.eye(4), HALF_TURN]))


def moved(x=0.0, deg=0.0):
    """A pose (4, 4) so far along x [m], turned by so much about z [deg]."""
    return se3.exp(np.array([x, 0.0, 0.0, 0.0, 0.0, 0.0])) @ se3.exp(np.array([0, 0, 0, 0, 0, np.radians(deg)]))


@pytest.mark.parametrize(("pose", "differs"), [(moved(0.9 * ANOTHER), False), (moved(1.1 * ANOTHER), True)])
def test_a_hypothesis_farther_away_is_another_one(pose, differs):
    assert another()(pose[None], np.eye(4))[0] == differs


@pytest.mark.parametrize(("deg", "differs"), [(-19.0, False), (19.0, False), (21.0, True), (180.0, True)])
def test_so_is_one_that_is_turned_however_near_it_is(deg, differs):
    assert another()(moved(0.001, deg)[None], np.eye(4))[0] == differs


@pytest.mark.parametrize(("deg", "differs"), [(180.0, False), (165.0, False), (150.0, True)])
def test_turns_that_no_touch_can_tell_do_not_count(deg, differs):
    assert another(SYMMETRY)(moved(0.001, deg)[None], np.eye(4))[0] == differs


def test_of_poses_that_do_not_differ_the_first_of_the_order_is_chosen():
    poses = np.stack([moved(0.0), moved(0.004), moved(0.0, 25.0), moved(0.03)])
    assert distinct(poses, [1, 0, 3, 2], another()) == [1, 3, 2]
    assert distinct(poses, range(4), farther(0.015, Symmetry())) == [0, 3]


def test_far_from_all_that_are_taken():
    poses = np.stack([moved(0.0), moved(0.02), moved(0.04)])
    np.testing.assert_array_equal(far_from([moved(0.001), moved(0.041)], poses, another()), [False, True, False])
    assert far_from([], poses, another()).all()
