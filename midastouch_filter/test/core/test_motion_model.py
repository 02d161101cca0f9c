import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.motion_model import ExplorationNoise, MotionModel, Odometry
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers

tangent = arrays(float, 6, elements=st.floats(-3, 3, allow_subnormal=False)).map(
    lambda xi: xi * [0.1, 0.1, 0.1, 1, 1, 1]
)
SILENT = FilterConfig(noise_translation=0.0, noise_rotation=0.0, noise_per_metre=0.0, noise_per_radian=0.0)


def model(config=SILENT, seed=0, threads=1):
    return MotionModel(config, np.random.default_rng(seed), Workers(threads))


def particles_of(poses):
    return Particles.from_poses(poses, np.zeros(len(poses), np.int32))


@given(st.lists(tangent, min_size=1, max_size=5), tangent)
def test_without_noise_it_composes_as_matrices_do(starts, step):
    poses, odometry = se3.exp(np.stack(starts)), se3.exp(step)
    particles = particles_of(poses)
    model().propagate(particles, Odometry.from_matrix(odometry), exploration=1.0)
    np.testing.assert_allclose(particles.poses, poses @ odometry, atol=2e-6)


def test_noise_has_the_stated_spread_in_the_moved_gel_frame():
    config = FilterConfig(noise_translation=4e-4, noise_rotation=0.02, noise_per_metre=0.1, noise_per_radian=0.1)
    start, odometry = se3.exp([0.1, 0, 0, 0.4, 1, 2]), se3.exp([2e-3, 0, 0, 0, 0, 0.1])
    particles = particles_of(np.repeat(start[None], 40_000, axis=0))
    motion = Odometry.from_matrix(odometry)
    model(config).propagate(particles, motion, exploration=1.0)
    noise = se3.log(se3.inverse(start @ odometry) @ particles.poses)
    np.testing.assert_allclose(noise[:, :3].std(axis=0), 4e-4 + 0.1 * motion.distance, rtol=0.03)
    np.testing.assert_allclose(noise[:, 3:].std(axis=0), 0.02 + 0.1 * motion.angle, rtol=0.03)
    np.testing.assert_allclose(noise.mean(axis=0), 0, atol=3e-4)
    off_diagonal = np.corrcoef(noise.T) - np.eye(6)
    assert np.abs(off_diagonal).max() < 0.03


def test_without_exploration_there_is_no_floor_of_noise():
    config = FilterConfig(noise_per_metre=0.0, noise_per_radian=0.0)
    particles = particles_of(np.repeat(np.eye(4)[None], 10, axis=0))
    model(config).propagate(particles, Odometry.from_matrix(se3.exp([0.01, 0, 0, 0, 0, 0])), exploration=0.0)
    assert np.ptp(particles.positions, axis=0).max() == 0


def test_noise_does_not_depend_on_the_number_of_threads():
    results = []
    for threads in (1, 3):
        particles = particles_of(np.repeat(np.eye(4)[None], 20_000, axis=0))
        model(FilterConfig(), seed=7, threads=threads).propagate(
            particles, Odometry.from_matrix(se3.exp([1e-3, 0, 0, 0, 0, 0])), exploration=1.0
        )
        results.append(particles.positions.tobytes() + particles.quaternions.tobytes())
    assert results[0] == results[1]


def test_a_hundred_thousand_steps_keep_rotations_orthonormal_and_agree_with_float64():
    step = se3.exp([1e-5, 2e-5, 0, 1e-3, -2e-3, 3e-3])
    particles = particles_of(np.eye(4)[None])
    motion, odometry = model(), Odometry.from_matrix(step)
    for _ in range(100_000):
        motion.propagate(particles, odometry, exploration=1.0)
    assert np.linalg.norm(particles.quaternions) == pytest.approx(1, abs=1e-6)
    exact = se3.exp(100_000 * se3.log(step))
    error = se3.log(se3.inverse(exact) @ particles.poses[0])
    assert np.linalg.norm(error[3:]) < 0.02
    assert np.linalg.norm(error[:3]) < 1e-3


@pytest.mark.parametrize(
    ("broken", "complaint"),
    [
        (np.full((4, 4), np.nan), "finite"),
        (np.eye(3), "shape"),
        (2 * np.eye(4), "rigid"),
        (np.diag([1.0, 1, -1, 1]), "rigid"),
    ],
)
def test_refuses_odometry_that_is_no_motion(broken, complaint):
    with pytest.raises(ValueError, match=complaint):
        Odometry.from_matrix(broken)


half_turns = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda axis: np.linalg.norm(axis) > 1e-3)


@given(half_turns)
@settings(max_examples=100)
def test_half_turns_about_any_axis_are_motions(axis):
    axis /= np.linalg.norm(axis)
    turn = se3.make(2 * np.outer(axis, axis) - np.eye(3), np.zeros(3))
    odometry = Odometry.from_matrix(turn)
    assert odometry.angle == pytest.approx(np.pi, abs=1e-6)
    particles = particles_of(turn[None])
    model().propagate(particles, odometry, 1.0)
    np.testing.assert_allclose(particles.poses[0], np.eye(4), atol=1e-6)


def test_exploration_anneals_while_one_mode_dominates_and_comes_back():
    exploration = ExplorationNoise(FilterConfig(converged_mass=0.8, noise_converged=0.25))
    for _ in range(3):
        exploration.update(0.5, 1.0)
    assert exploration.fraction == 1.0
    fractions = []
    for _ in range(20):
        exploration.update(0.9, 0.5)
        fractions.append(exploration.fraction)
    assert (np.diff(fractions) <= 0).all()
    assert fractions[-1] == 0.25
    exploration.update(0.5, 1.0)
    assert exploration.fraction > 0.25
