import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core import initialisation
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.motion_model import MotionModel
from midastouch_filter.core.pose_hypothesis import PoseHypothesis
from midastouch_filter.core.workers import Workers


@pytest.mark.parametrize("n", [1, 99, 100, 101, 250])
def test_uniform_uses_every_entry_equally_often(n):
    entries = initialisation.uniform_entries(100, n, np.random.default_rng(0))
    counts = np.bincount(entries, minlength=100)
    assert len(entries) == n
    assert np.ptp(counts) <= 1


def test_gaussian_has_the_stated_spread():
    centre = se3.exp([0.1, 0.2, 0.3, 1, 2, 0.5])
    poses = initialisation.gaussian_poses(centre, 0.02, 0.3, 40_000, np.random.default_rng(0))
    np.testing.assert_allclose(poses[:, :3, 3].mean(axis=0), centre[:3, 3], atol=5e-4)
    np.testing.assert_allclose(poses[:, :3, 3].std(axis=0), 0.02, rtol=0.02)
    turn = se3.log(se3.inverse(centre) @ poses)[:, 3:]
    np.testing.assert_allclose(turn.std(axis=0), 0.3, rtol=0.02)
    np.testing.assert_allclose(np.linalg.det(poses[:, :3, :3]), 1, atol=1e-9)


@pytest.fixture(scope="module")
def lookup(world):
    return PoseLookup(world.poses, Workers(1))


def source(lookup, jitter, seed=0, threads=1):
    rng, workers = np.random.default_rng(seed), Workers(threads)
    motion_model = MotionModel(FilterConfig(threads=threads), rng, workers)
    return initialisation.ParticleSource(lookup, motion_model, jitter, rng, workers)


COVARIANCE = np.diag([1.5e-3, 1e-3, 5e-4, 0.05, 0.1, 0.2]) ** 2
COVARIANCE[0, 5] = COVARIANCE[5, 0] = 1.5e-4
JITTER = np.diag([5e-4] * 3 + [0.01] * 3) ** 2


def test_particles_at_a_hypothesis_are_spread_as_it_says(lookup):
    hypothesis = PoseHypothesis(lookup.poses[4000], COVARIANCE, 0.5)
    born = source(lookup, JITTER).at(hypothesis, 40_000)
    offset = se3.log(se3.inverse(hypothesis.pose) @ born.poses)
    spread = np.sqrt(np.diag(COVARIANCE + JITTER))
    np.testing.assert_allclose(np.cov(offset.T) / np.outer(spread, spread),
                               (COVARIANCE + JITTER) / np.outer(spread, spread), atol=0.03)  # fmt: skip
    assert np.abs(offset.mean(axis=0) / spread).max() < 0.03
    assert born.weights.sum() == pytest.approx(1)


def test_particles_among_hypotheses_lie_where_the_scores_say(lookup):
    hypotheses = lookup.poses[[10, 4000]]
    born = source(lookup, JITTER).among(hypotheses, np.log([0.25, 0.75]), COVARIANCE, 20_000)
    distance = np.linalg.norm(born.positions[:, None] - hypotheses[:, :3, 3], axis=2)
    assert (distance.min(axis=1) < 0.01).all()
    assert (distance.argmin(axis=1) == 1).mean() == pytest.approx(0.75, abs=0.02)


def test_born_particles_know_their_entries(lookup):
    born = source(lookup, JITTER).among(lookup.poses[::100], np.zeros(80), COVARIANCE, 8000)
    np.testing.assert_array_equal(born.entries, lookup.exact(born.poses))


def test_births_do_not_depend_on_the_number_of_threads(lookup):
    one, two = (source(lookup, JITTER, 3, threads).at(PoseHypothesis(lookup.poses[7], COVARIANCE, 1.0), 9000)
                for threads in (1, 2))  # fmt: skip
    np.testing.assert_array_equal(one.poses, two.poses)
    np.testing.assert_array_equal(one.entries, two.entries)
