import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_common import se3
from midastouch_common.pose_metric import pose_distance
from midastouch_filter.core.pose_difference import ANOTHER, NO_SYMMETRY, Prior, alike, another
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


@given(st.integers(0, 2**32 - 1))
def test_all_pairs_at_once_are_told_as_one_by_one(seed):
    poses = se3.exp(np.random.default_rng(seed).normal(size=(20, 6)) * np.repeat([6e-3, 0.2], 3)) @ moved(0.3)
    np.testing.assert_array_equal(alike(poses), ~np.stack([another()(poses, pose) for pose in poses]))


def test_distances_count_a_radian_as_ten_millimetres():
    poses = np.stack([moved(0.003), moved(0.0, 10.0), moved(0.004, 10.0)])
    turned = 0.02 * np.sin(np.radians(5.0))
    np.testing.assert_allclose(pose_distance(poses, np.eye(4)), [0.003, turned, np.hypot(0.004, turned)])


def test_a_prior_is_normal_with_a_floor_modulo_symmetry():
    prior = Prior(moved(0.01), 2e-3, np.radians(5.0))
    poses = np.stack([moved(0.01), moved(0.014), moved(0.01, 10.0), moved(0.3), HALF_TURN @ moved(0.01)])
    np.testing.assert_allclose(prior.log_density(poses, -12.0, SYMMETRY), [0, -2, -2, -12, 0], atol=1e-9)
    assert prior.log_density(poses, -12.0, NO_SYMMETRY)[-1] == -12
    wide = prior.widened(np.diag([9e-6] * 3 + [0.0] * 3))
    np.testing.assert_allclose(wide.covariance, prior.covariance + np.diag([9e-6] * 3 + [0.0] * 3))
