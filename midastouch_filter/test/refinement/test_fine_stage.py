import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_common import se3
from midastouch_filter.core.particles import Particles
from midastouch_filter.refinement.fine_stage import impose_fractions, pool_marginal_likelihoods


def particles_at(n, rng):
    poses = se3.make(se3.random_rotations(n, rng), rng.standard_normal((n, 3)))
    out = Particles.from_poses(poses, np.zeros(n, int))
    out.log_weights = np.log(rng.dirichlet(np.ones(n)))
    return out


def drawn_at_random(hypothesis, count):
    return particles_at(count, np.random.default_rng(count))


def no_draw(hypothesis, count):
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


def test_modes_and_the_rest_get_their_fractions():
    particles = particles_at(90, np.random.default_rng(0))
    members = np.repeat([0, 1, -1], 30)
    out, new = impose_fractions(particles, members, [1, 0], np.array([0.6, 0.2]), 0.2, drawn_at_random)
    assert new == (particles.weights[60:].sum() < 0.2)
    weights = out.weights
    assert weights[30:60].sum() == pytest.approx(0.6)
    assert weights[:30].sum() == pytest.approx(0.2)
    assert weights.sum() == pytest.approx(1)


def test_the_same_fractions_again_change_nothing():
    particles = particles_at(60, np.random.default_rng(0))
    arguments = np.repeat([0, 1], 30), [0, 1], np.array([0.5, 0.5]), 0.0, no_draw
    once, _ = impose_fractions(particles, *arguments)
    twice, _ = impose_fractions(once, *arguments)
    np.testing.assert_allclose(twice.log_weights, once.log_weights, atol=1e-9)


def test_a_hypothesis_without_a_mode_gets_particles_of_its_weight():
    rng = np.random.default_rng(1)
    particles = particles_at(400, rng)
    fractions = np.array([0.5, 0.5, 1e-9])
    out, new = impose_fractions(particles, np.zeros(400, int), [0, None, None], fractions, 0.0, drawn_at_random)
    assert new == 1
    assert len(out) == 600
    assert out.weights[400:].sum() == pytest.approx(0.5)


def test_what_lies_elsewhere_is_born_there():
    particles = particles_at(400, np.random.default_rng(1))
    asked = []

    def draw(hypothesis, count):
        asked.append(hypothesis)
        return drawn_at_random(hypothesis, count)

    out, new = impose_fractions(particles, np.zeros(400, int), [0], np.array([0.25]), 0.75, draw)
    assert (asked, new) == ([None], 1)
    assert out.weights[400:].sum() == pytest.approx(0.75)


def test_a_rest_that_was_not_looked_at_is_kept():
    particles = particles_at(60, np.random.default_rng(3))
    members = np.repeat([0, -1], 30)
    rest = particles.weights[30:].sum()
    for exact, expected in ((True, 0.01), (False, rest)):
        out, _ = impose_fractions(particles, members, [0], np.array([0.99]), 0.01, no_draw, exact)
        assert out.weights[30:].sum() == pytest.approx(expected)
        assert out.weights.sum() == pytest.approx(1)


def test_a_refuted_mode_keeps_a_trace():
    particles = particles_at(20, np.random.default_rng(2))
    members = np.repeat([0, 1], 10)
    out, _ = impose_fractions(particles, members, [0, 1], np.array([1.0, 0.0]), 0.0, no_draw)
    assert 0 < out.weights[10:].sum() < 1e-8
    assert np.isfinite(out.log_weights).all()
