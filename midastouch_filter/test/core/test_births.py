import math

import numpy as np
import pytest
from filter_runs import hypotheses_at, model_of

from midastouch_common import se3
from midastouch_common.pose_metric import pose_distance
from midastouch_filter.core.belief import Belief
from midastouch_filter.core.births import Births
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.pose_difference import Prior

NOISE = NoiseModel.of(FilterConfig())
ALL = 10_000


@pytest.fixture(scope="module")
def model(world):
    return model_of(world)


@pytest.fixture
def belief(model):
    return Belief([model])


def mass(belief):
    return np.exp(belief.total())


def draws_near(belief, pose, reach):
    """Fraction of the weight on poses nearer than `reach` [m] to a pose."""
    hypotheses, some = belief.hypotheses, belief.untested[0]
    poses = np.concatenate([hypotheses.poses, some.poses])
    weights = np.exp(np.concatenate([hypotheses.log_weights, some.log_weights]) - belief.total())
    return weights[pose_distance(poses, pose) < reach].sum()


def test_from_nothing_known_every_entry_is_as_probable(belief, model):
    Births(NOISE, ALL).anywhere(belief, 0.0)
    (some,) = belief.untested
    np.testing.assert_array_equal(some.entries, np.arange(8000))
    np.testing.assert_allclose(some.poses, model.lookup.poses, atol=1e-6)
    assert np.ptp(some.log_weights) == 0
    assert mass(belief) == pytest.approx(1.0)


def test_of_a_large_codebook_the_first_in_its_order_are_expected(belief, model):
    Births(NOISE, 500).anywhere(belief, 0.0)
    np.testing.assert_array_equal(np.sort(model.order[belief.untested[0].entries]), np.arange(500))
    assert mass(belief) == pytest.approx(1.0)


def test_objects_share_alike_however_many_entries_they_have(model, world):
    belief = Belief([model, model_of(world, world.make_codebook(world.poses[:300], world.codebook.codes[:300]))])
    Births(NOISE, ALL).anywhere(belief, math.log(0.2))
    np.testing.assert_allclose([np.exp(some.log_weights).sum() for some in belief.untested], [0.1, 0.1])


@pytest.mark.parametrize(("sigma_t", "sigma_r", "reach"), [(1e-4, 1e-3, 0.01), (3e-3, 0.05, 0.015), (0.02, 0.3, 0.06)])
def test_near_a_prior_poses_are_probable_however_sharp_it_is(belief, model, sigma_t, sigma_r, reach):
    """Sharper than the entries are apart, too."""
    pose = model.lookup.poses[100] @ se3.exp([2e-3, -2e-3, 0, 0, 0, 0.1])
    Births(NOISE, ALL).anywhere(belief, 0.0, Prior(pose, sigma_t, sigma_r))
    assert draws_near(belief, pose, reach) > 0.9
    assert mass(belief) == pytest.approx(1.0)
    assert len(belief.untested[0]) == 8000, "the prior may be wrong"


def test_a_change_keeps_all_and_spreads_its_probability_evenly(belief):
    belief.hypotheses = hypotheses_at(se3.translation([0, 0, 0.01])[None], np.array([3.0]))
    assert Births(NOISE, ALL).after_change(belief, 0.25)
    assert mass(belief) == pytest.approx(1.0)
    assert belief.untested_mass == pytest.approx(0.25)
    assert np.ptp(belief.untested[0].log_weights) == 0


def test_repeated_changes_do_not_add_up_without_end(belief):
    births = Births(NOISE, ALL)
    belief.hypotheses = hypotheses_at(np.eye(4)[None], np.zeros(1))
    born = [births.after_change(belief, 0.1) for _ in range(10)]
    assert born[0]
    assert not born[-1]
    assert len(belief) < 4 * 8000
    assert mass(belief) == pytest.approx(1.0)


def test_another_finger_s_search_begins_where_it_touches(belief, model):
    births, gel = Births(NOISE, ALL), se3.translation([0.03, 0, 0]) @ se3.exp([0, 0, 0, 0, 1.0, 0])
    births.anywhere(belief, 0.0)
    births.of_finger(belief, gel)
    np.testing.assert_allclose(belief.untested[0].poses @ gel, model.lookup.poses, atol=1e-5)
    assert mass(belief) == pytest.approx(1.0)


def test_a_prior_is_about_the_first_finger_whichever_touches(belief, model):
    pose, births = model.lookup.poses[100], Births(NOISE, ALL)
    births.anywhere(belief, 0.0, Prior(pose, 0.02, 0.3))
    births.of_finger(belief, se3.translation([0.03, 0, 0]))
    assert draws_near(belief, pose, 0.06) > 0.9
