from dataclasses import replace

import numpy as np
import pytest
from filter_runs import hypotheses_at, model_of
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_filter.core.alignment import Sighting
from midastouch_filter.core.answer import covariance_of, draws, grouped, modes_of
from midastouch_filter.core.belief import Belief
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry

NOISE = NoiseModel.of(FilterConfig())
HALF_TURN = se3.make(np.diag([-1.0, -1, 1]), np.zeros(3))
TWOFOLD = ObjectSymmetry(Symmetry(np.stack([np.eye(4), HALF_TURN])))


@pytest.fixture
def model(world):
    return model_of(world)


def belief_of(model, poses, weights, **known):
    belief = Belief([model])
    belief.hypotheses = hypotheses_at(np.asarray(poses), np.log(weights), **known)
    return belief


def at(x, turned=0.0):
    return se3.exp([x, 0.0, 0.02, 0.0, 0.0, turned])


def modes(belief, sightings=()):
    return modes_of(belief, grouped(belief), dict(sightings), 1.0, NOISE)


def moment_about(pose, poses, weights):
    """Second moment of position and rotation vector about fixed axes."""
    turned = Rotation.from_matrix(poses[:, :3, :3] @ pose[:3, :3].T).as_rotvec()
    offset = np.concatenate([poses[:, :3, 3] - pose[:3, 3], turned], axis=1)
    return (weights[:, None] * offset).T @ offset


def test_near_hypotheses_make_one_mode_and_no_weight_is_lost(model):
    belief = belief_of(model, [at(0.03), at(0.0), at(4e-3), at(0.0, 0.6)], [0.3, 0.4, 0.1, 0.2])
    found = modes(belief)
    np.testing.assert_allclose([mode.weight for mode in found], [0.5, 0.3, 0.2])
    assert [mode.n for mode in found] == [2, 1, 1]
    np.testing.assert_allclose(found[0].pose, at(0.0))


def test_a_mode_of_many_light_ones_may_be_the_first(model):
    belief = belief_of(model, [at(0.0), at(0.05), at(0.051), at(0.052)], [0.4, 0.25, 0.2, 0.15])
    assert modes(belief)[0].weight == pytest.approx(0.6)
    np.testing.assert_allclose(modes(belief)[0].pose, at(0.05))


@pytest.mark.parametrize("alike", [False, True])
def test_poses_that_feel_the_same_are_one_mode(model, alike):
    model.symmetry = TWOFOLD if alike else ObjectSymmetry()
    belief = belief_of(model, [at(0.03), HALF_TURN @ at(0.032)], [0.6, 0.4])
    found = modes(belief)
    np.testing.assert_allclose([mode.weight for mode in found], [1.0] if alike else [0.6, 0.4])
    assert found[0].spread_translation < 3e-3


def test_untested_poses_take_their_weight_from_the_modes(model):
    belief = belief_of(model, [at(0.0)], [0.3])
    belief.expect(0, np.arange(50), np.full(50, np.log(0.7 / 50)))
    assert modes(belief)[0].weight == pytest.approx(0.3)


def test_hypotheses_on_different_objects_are_never_one_mode(world):
    belief = Belief([model_of(world), model_of(world)])
    belief.hypotheses = hypotheses_at(np.stack([at(0.0), at(0.0)]), np.log([0.3, 0.7]), numbers=(0, 1))
    assert [(group.object, round(group.weight, 9)) for group in grouped(belief)] == [(1, 0.7), (0, 0.3)]


def test_the_number_of_modes_is_bounded(model):
    poses = [at(0.02 * k) for k in range(300)]
    assert 10 < len(modes(belief_of(model, poses, np.full(300, 1 / 300)))) < 200


def test_without_hypotheses_there_are_no_modes(model):
    assert grouped(Belief([model])) == []


def test_modes_are_of_the_present_frame(model):
    belief = belief_of(model, [at(0.0)], [1.0])
    belief.since = se3.exp([0.01, 0, 0, 0, 0.3, 0])
    np.testing.assert_allclose(modes(belief)[0].pose, at(0.0) @ belief.since)


def test_a_mode_is_published_where_it_is_seen(model):
    belief = belief_of(model, [at(0.0), at(0.05)], [0.6, 0.4])
    seen = at(1e-3)
    (here, there) = modes(belief, {0: Sighting(seen, 1e-8 * np.eye(6), 0.9)})
    np.testing.assert_allclose(here.pose, seen)
    assert here.spread_translation < there.spread_translation
    worse = modes(belief, {0: Sighting(seen, 1e-8 * np.eye(6), 0.7)})[0]
    assert worse.spread_translation > here.spread_translation, "the less is explained, the wider"


def test_a_covariance_is_about_fixed_axes_of_the_object(model):
    """REP-103: x, y, z, then rotations about the object's own X, Y, Z, not about the moving gel frame's."""
    pose, rng = se3.exp([0.03, 0.01, 0.02, 0.7, -1.2, 0.4]), np.random.default_rng(0)
    own = np.diag([3e-3, 1e-3, 1e-4, 0.05, 0.02, 0.01]) ** 2
    belief = belief_of(model, [pose], [1.0])
    mode = modes(belief, {0: Sighting(pose, own / NOISE.residual_floor, 1.0)})[0]
    xi = rng.multivariate_normal(np.zeros(6), own, 50_000)
    samples = pose @ se3.exp(xi)
    found = moment_about(pose, samples, np.full(len(xi), 1 / len(xi)))
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    np.testing.assert_allclose(mode.covariance / scale, found / scale, atol=0.03)


def test_members_of_a_mode_are_part_of_its_covariance(model):
    belief = belief_of(model, [at(0.0), at(8e-3)], [0.5, 0.5], sigma_t=1e-6, sigma_r=1e-6)
    (mode,) = modes(belief)
    assert mode.covariance[0, 0] == pytest.approx(0.5 * 8e-3**2, rel=0.05)


def test_the_whole_covariance_holds_the_other_modes(model):
    poses, weights = np.stack([at(0.0), at(0.05), at(-0.02, 2.0)]), np.array([0.7, 0.2, 0.1])
    belief = belief_of(model, poses, weights)
    found = modes(belief)
    expected = weights[0] * found[0].covariance + moment_about(poses[0], poses[1:], weights[1:])
    np.testing.assert_allclose(covariance_of(belief, 0, found), expected, rtol=1e-6, atol=1e-15)


def test_the_whole_covariance_holds_untested_poses(model):
    belief = belief_of(model, [at(0.0)], [0.5])
    belief.expect(0, np.arange(8000), np.full(8000, np.log(0.5 / 8000)))
    found = modes(belief)
    untested = moment_about(found[0].pose, model.lookup.poses, np.full(8000, 0.5 / 8000))
    expected = np.diag(0.5 * found[0].covariance + untested)
    np.testing.assert_allclose(np.diag(covariance_of(belief, 0, found)), expected, rtol=0.3)


def test_covariance_and_draws_leave_other_objects_out(model):
    belief = belief_of(model, [at(0.0), at(0.3)], [0.5, 0.1])
    belief.objects, belief.untested = [model, model], [belief.untested[0], belief.untested[0]]
    belief.hypotheses = replace(belief.hypotheses, objects=np.array([0, 1], np.int32))
    belief.expect(1, np.arange(100), np.full(100, np.log(0.4 / 100)))
    (mode,) = [each for each in modes(belief) if each.weight > 0.2]
    np.testing.assert_allclose(covariance_of(belief, 0, [mode]), mode.covariance)
    assert np.linalg.norm(draws(belief, 0, 50, seed=1)[:, :3, 3] - at(0.0)[:3, 3], axis=1).max() < 0.1


def test_a_half_turn_counts_as_one(model):
    """The rotation vector's length is the angle, not the chord."""
    belief = belief_of(model, [at(0.0), at(0.0, np.pi - 1e-3)], [0.5, 0.5])
    found = covariance_of(belief, 0, modes(belief))
    assert found[5, 5] == pytest.approx(0.5 * (np.pi - 1e-3) ** 2, rel=1e-2)


def test_draws_follow_the_mixture(model):
    belief = belief_of(model, [at(0.2), at(0.3)], [0.5, 0.2], sigma_t=2e-3, sigma_r=1e-4)
    belief.expect(0, np.arange(100), np.full(100, np.log(0.3 / 100)))
    belief.since = since = se3.translation([0.0, 0.1, 0.0])
    drawn = draws(belief, 0, 4000, seed=1)
    assert drawn.shape == (4000, 4, 4)
    near = [np.linalg.norm(drawn[:, :3, 3] - (at(x) @ since)[:3, 3], axis=1) < 0.02 for x in (0.2, 0.3)]
    np.testing.assert_allclose([each.mean() for each in near], [0.5, 0.2], atol=0.01)
    np.testing.assert_allclose(drawn[near[0], :3, 3].std(axis=0), 2e-3, rtol=0.1)
    untested = np.concatenate([drawn[~(near[0] | near[1])] @ se3.inverse(since)])
    offset = np.abs(untested[:, None, :3, 3] - model.lookup.poses[None, :100, :3, 3]).max(axis=2)
    assert offset.min(axis=1).max() < 1e-6
    assert len(np.unique(offset.argmin(axis=1))) == 100
