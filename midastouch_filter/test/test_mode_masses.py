import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_filter.mode_masses import impose_log_odds, pool_marginal_likelihoods
from midastouch_filter.particles import Particles
from midastouch_perception import se3


def particles_at(n, rng):
    poses = se3.make(se3.random_rotations(n, rng), rng.standard_normal((n, 3)))
    out = Particles.from_poses(poses, np.zeros(n, int))
    out.log_weights = np.log(rng.dirichlet(np.ones(n)))
    return out


def no_draw(place, count):
    raise AssertionError("nothing to draw")


@given(st.integers(0, 1000))
def test_parts_gain_the_same_and_keep_their_inside(seed):
    rng = np.random.default_rng(seed)
    weights, ratio = np.log(rng.dirichlet(np.ones(60))), rng.normal(0, 2, 60)
    parts = [np.arange(20), np.arange(20, 30)]
    changed = ratio.copy()
    pool_marginal_likelihoods(weights, changed, parts)
    before, after = np.exp(weights), np.exp(weights + changed)
    gains = [after[part].sum() / before[part].sum() for part in parts]
    assert gains[0] == pytest.approx(gains[1])
    # together they gain what they would have gained anyhow
    both = np.concatenate(parts)
    assert after[both].sum() == pytest.approx(np.exp(weights + ratio)[both].sum())
    np.testing.assert_allclose(np.ptp((changed - ratio)[parts[0]]), 0, atol=1e-12)
    np.testing.assert_array_equal(changed[30:], ratio[30:])


def test_one_part_alone_is_left_as_it_is():
    ratio = np.arange(5.0)
    pool_marginal_likelihoods(np.zeros(5), ratio, [np.arange(3), np.arange(0)])
    np.testing.assert_array_equal(ratio, np.arange(5.0))


def test_modes_get_the_odds_and_the_rest_keeps_its_weight():
    particles = particles_at(90, np.random.default_rng(0))
    members = np.repeat([0, 1, -1], 30)
    rest = particles.weights[60:].sum()
    out, new = impose_log_odds(particles, members, [1, 0], np.log([3.0, 1.0]), no_draw)
    assert new == 0
    weights = out.weights
    assert weights[60:].sum() == pytest.approx(rest)
    assert weights[30:60].sum() == pytest.approx(3 * weights[:30].sum())
    assert weights.sum() == pytest.approx(1)


def test_a_place_without_a_mode_gets_particles_of_its_weight():
    rng = np.random.default_rng(1)
    particles = particles_at(400, rng)
    out, new = impose_log_odds(
        particles, np.zeros(400, int), [0, None, None], np.array([0.0, 0.0, -20.0]), lambda _, n: particles_at(n, rng)
    )
    assert new == 1
    assert len(out) == 600
    assert out.weights[400:].sum() == pytest.approx(0.5)


def test_the_rest_can_be_held_small():
    particles = particles_at(60, np.random.default_rng(3))
    members = np.repeat([0, -1], 30)
    out, _ = impose_log_odds(particles, members, [0], np.zeros(1), no_draw, rest=0.01)
    assert out.weights[30:].sum() == pytest.approx(0.01)
    assert out.weights.sum() == pytest.approx(1)


def test_a_refuted_mode_keeps_a_trace():
    particles = particles_at(20, np.random.default_rng(2))
    members = np.repeat([0, 1], 10)
    out, _ = impose_log_odds(particles, members, [0, 1], np.array([0.0, -500.0]), no_draw)
    assert 0 < out.weights[10:].sum() < 1e-8
    assert np.isfinite(out.log_weights).all()
