import numpy as np
import pytest
from filter_runs import hypotheses_at, model_of
from hypothesis import given
from hypothesis import strategies as st

from midastouch_common import se3
from midastouch_filter.core.belief import Belief, Hypotheses
from midastouch_perception.symmetry.group import Symmetry

HALF_TURN = se3.make(np.diag([-1.0, -1, 1]), np.zeros(3))
COVARIANCE = np.diag([1.0, 2, 3, 100, 200, 300]) * 1e-6


def along_x(*metres):
    return np.stack([se3.translation([x, 0.0, 0.0]) for x in metres])


def test_merging_keeps_the_heaviest_with_the_weight_of_all():
    merged = hypotheses_at(along_x(1e-3, 0.0, 0.03), np.log([0.3, 0.5, 0.2])).merged(Symmetry())
    np.testing.assert_allclose(merged.poses, along_x(0.0, 0.03))
    np.testing.assert_allclose(np.exp(merged.log_weights), [0.8, 0.2])


def test_a_row_of_neighbours_does_not_collapse_into_one():
    merged = hypotheses_at(along_x(0.0, 1.5e-3, 3e-3), np.log([0.5, 0.3, 0.2])).merged(Symmetry())
    np.testing.assert_allclose(merged.poses, along_x(0.0, 3e-3))


def test_those_that_are_turned_have_not_met():
    poses = se3.exp(np.radians([[0, 0, 0, 0, 0, deg] for deg in (0.0, 1.0, 4.0)]))
    assert len(hypotheses_at(poses, np.log([0.5, 0.3, 0.2])).merged(Symmetry())) == 2


def test_a_pose_that_feels_the_same_is_the_same():
    poses = se3.exp([[0.02, 0, 0.01, 0.3, 0, 0], [0.02, 5e-4, 0.01, 0.3, 0, 0]])
    hypotheses = hypotheses_at(np.stack([poses[0], HALF_TURN @ poses[1]]), np.log([0.6, 0.4]))
    assert len(hypotheses.merged(Symmetry())) == 2
    (pose,) = hypotheses.merged(Symmetry(np.stack([np.eye(4), HALF_TURN]))).poses
    np.testing.assert_allclose(pose, poses[0], atol=1e-12)


def test_around_the_axis_of_a_can_there_is_one_hypothesis():
    turns = se3.exp([[0, 0, 0, 0, 0, angle] for angle in np.linspace(0, 6, 50)])
    hypotheses = hypotheses_at(turns @ se3.translation([0.03, 0, 0]), np.zeros(50))
    assert len(hypotheses.merged(Symmetry(free="axis"))) == 1


@given(st.integers(0, 2**32 - 1), st.integers(0, 60))
def test_no_two_that_are_left_have_met_and_no_weight_is_lost(seed, count):
    rng = np.random.default_rng(seed)
    poses = se3.exp(rng.normal(size=(count, 6)) * np.repeat([2e-3, 0.03], 3))
    hypotheses = hypotheses_at(poses, rng.normal(size=count))
    merged = hypotheses.merged(Symmetry())
    assert np.exp(merged.log_weights).sum() == pytest.approx(np.exp(hypotheses.log_weights).sum())
    between = se3.log(se3.inverse(merged.poses)[:, None] @ merged.poses[None])
    apart = np.hypot(np.linalg.norm(between[..., :3], axis=-1) / 2e-3,
                     np.linalg.norm(between[..., 3:], axis=-1) / np.radians(2))  # fmt: skip
    assert (apart + 2 * np.eye(len(merged)) > 0.999).all()


def test_a_covariance_moves_with_its_frame():
    motion, rng = se3.exp([0.05, -0.02, 0.08, 0.4, -1.0, 2.0]), np.random.default_rng(0)
    hypotheses = Hypotheses.at(np.tile(np.eye(4), (3, 1, 1)), COVARIANCE, np.zeros(3), 0, 0.0)
    hypotheses.covariances[1] *= 4.0
    moved = hypotheses.moved(motion)
    np.testing.assert_allclose(moved.covariances[1:], moved.covariances[[0, 0]] * [[[4.0]], [[1.0]]])
    np.testing.assert_allclose(moved.poses[0], motion)
    samples = se3.exp(rng.multivariate_normal(np.zeros(6), COVARIANCE, 20_000)) @ motion
    empirical = np.cov(se3.log(se3.inverse(motion) @ samples).T)
    scale = np.sqrt(np.outer(np.diag(empirical), np.diag(empirical)))
    np.testing.assert_allclose(moved.covariances[0] / scale, empirical / scale, atol=0.05)


def test_the_way_since_the_last_alignment_widens_once():
    drift = np.diag([1.0, 1, 1, 4, 4, 4])
    hypotheses = hypotheses_at(along_x(0.0), np.zeros(1))
    there = hypotheses.drifted(2.0, drift)
    np.testing.assert_allclose(there.covariances[0] - hypotheses.covariances[0], 2 * drift)
    np.testing.assert_allclose(there.drifted(2.0, drift).covariances, there.covariances)


@pytest.fixture
def belief(world):
    """On two objects of the same shape: hypotheses on both, and untested poses on the second."""
    models = [model_of(world), model_of(world)]
    belief = Belief(models)
    belief.hypotheses = hypotheses_at(along_x(0.0, 0.0, 0.05), np.log([0.3, 0.2, 0.1]), numbers=(0, 1, 1))
    belief.expect(1, np.arange(100), np.full(100, np.log(0.4 / 100)))
    return belief


def test_poses_come_up_to_the_present_frame(belief):
    before, untested = belief.hypotheses.poses, belief.untested[1].poses
    belief.since = motion = se3.exp([0.01, 0, 0.02, 0, 0.3, 0])
    belief.come_up(0.1, np.zeros((6, 6)))
    np.testing.assert_allclose(belief.hypotheses.poses, before @ motion, atol=1e-12)
    np.testing.assert_allclose(belief.untested[1].poses, untested @ motion, atol=1e-6)
    np.testing.assert_array_equal(belief.since, np.eye(4))


def test_untested_poses_are_expected_by_entry_and_taken_by_row(belief, world):
    model = belief.objects[0]
    belief.expect(0, np.array([7, 5, 9]), np.log([0.1, 0.2, 0.3]))
    taken = belief.take(0, np.array([2, 0]))
    np.testing.assert_array_equal(taken.entries, [9, 7])
    np.testing.assert_allclose(taken.poses, model.lookup.poses[[9, 7]], atol=1e-6)
    np.testing.assert_allclose(np.exp(taken.log_weights), [0.3, 0.1])
    np.testing.assert_array_equal(belief.untested[0].entries, [5])
    assert len(belief) == 3 + 100 + 1


def test_settling_normalises_and_merges_on_each_object_alone(belief):
    belief.scale(3.0)
    assert belief.untested_mass == pytest.approx(0.4)
    belief.settle(-30.0)
    assert belief.total() == pytest.approx(0.0)
    assert belief.hypotheses.objects.tolist() == [0, 1, 1]
    np.testing.assert_allclose(np.exp(belief.hypotheses.log_weights), [0.3, 0.2, 0.1])


def test_what_is_too_light_to_matter_goes(belief):
    belief.hypotheses = belief.hypotheses.joined(hypotheses_at(along_x(0.1), np.array([-30.0])))
    belief.expect(0, np.arange(50), np.full(50, -9.0))
    belief.settle(-7.0)
    assert len(belief.hypotheses) == 3
    assert [len(some) for some in belief.untested] == [0, 100]
    belief.settle(-0.1)
    assert [len(some) for some in belief.untested] == [0, 0]
    assert len(belief.hypotheses) == 3, "the limit is that of untested poses"
