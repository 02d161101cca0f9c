import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_filter.core.belief import Belief, covariance_about
from midastouch_filter.core.estimate import Mode
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.modes import ModeFinder, Regions
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers
from midastouch_perception.symmetry.group import Symmetry


def spread(n, rng):
    """Particles all over a 0.2 m cube in all orientations, with uneven weights."""
    poses = se3.make(Rotation.random(n, rng).as_matrix(), rng.uniform(-0.1, 0.1, (n, 3)))
    particles = Particles.from_poses(poses, np.zeros(n, int))
    weights = rng.random(n)
    return particles, weights / weights.sum()


def moment_about(pose, particles, weights):
    turn = Rotation.from_quat(particles.quaternions) * Rotation.from_matrix(pose[:3, :3]).inv()
    d = np.concatenate([particles.positions - pose[:3, 3], turn.as_rotvec()], axis=1)
    return (weights[:, None] * d).T @ d


def test_other_hypotheses_are_part_of_it():
    rng = np.random.default_rng(0)
    particles, weights = spread(300, rng)
    pose = se3.exp(np.array([0.01, 0.02, 0.03, 0.4, 0.5, 0.6]))
    mode = Mode(0.0, pose, np.diag([1.0, 2, 3, 4, 5, 6]) * 1e-6, 0)
    others = (np.arange(300) >= 100).astype(np.int32)
    expected = weights[:100].sum() * mode.covariance
    expected += moment_about(pose, particles, np.where(others, weights, 0))
    np.testing.assert_allclose(covariance_about(mode, others, particles, weights), expected, rtol=1e-4, atol=1e-9)


def test_many_particles_are_sampled():
    rng = np.random.default_rng(1)
    particles, weights = spread(40_000, rng)
    mode = Mode(0.0, np.eye(4), np.zeros((6, 6)), 0)
    found = covariance_about(mode, np.ones(40_000, np.int32), particles, weights)
    np.testing.assert_allclose(np.diag(found), np.diag(moment_about(np.eye(4), particles, weights)), rtol=0.1)


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_alone_a_mode_keeps_its_covariance(weight):
    """No other particles, or others that weigh nothing."""
    particles, _ = spread(20, np.random.default_rng(2))
    mode = Mode(1.0, np.eye(4), np.diag([1.0, 2, 3, 4, 5, 6]), 20)
    others = np.full(20, weight == 0.0, np.int32)
    weights = np.full(20, weight / 20)
    np.testing.assert_array_equal(covariance_about(mode, others, particles, weights), mode.covariance)


def test_a_half_turn_counts_as_one():
    """The rotation vector's length is the angle, not the chord."""
    half_turn = se3.make(Rotation.from_rotvec([0, 0, np.pi - 1e-3]).as_matrix()[None], np.zeros((1, 3)))
    mode = Mode(0.5, np.eye(4), np.zeros((6, 6)), 1)
    particles = Particles.from_poses(half_turn, np.zeros(1, int))
    found = covariance_about(mode, np.ones(1, np.int32), particles, np.array([0.5]))
    assert found[5, 5] == pytest.approx(0.5 * (np.pi - 1e-3) ** 2, rel=1e-3)


def ring(n: int) -> np.ndarray:
    """Poses (n, 4, 4) around a can of 60 mm about z, each looking at its axis."""
    turns = Rotation.from_rotvec(np.linspace(0, 2 * np.pi, n, endpoint=False)[:, None] * [0, 0, 1]).as_matrix()
    start = se3.make(Rotation.from_euler("y", -90, degrees=True).as_matrix(), np.array([0.03, 0, 0]))
    return se3.make(turns, np.zeros(3)) @ start


def belief_of(poses: np.ndarray, weights: np.ndarray, symmetry: Symmetry) -> Belief:
    """A belief on the can, clustered."""
    lookup = PoseLookup(ring(240), Workers(1))
    finder = ModeFinder(lookup, Regions(lookup, 0.005), 0.012, 0.01, Workers(1))
    particles = Particles.from_poses(poses, lookup.exact(poses))
    particles.log_weights = np.log(weights / weights.sum())
    belief = Belief(particles, lookup, finder, symmetry)
    belief.cluster()
    return belief


HALF_TURN = se3.make(np.diag([-1.0, -1, 1]), np.zeros(3))


def test_modes_that_the_symmetry_maps_onto_each_other_are_one():
    near = ring(240)[:3]
    poses, weights = np.concatenate([near, HALF_TURN @ near]), np.repeat([0.6, 0.4], 3)
    assert [round(mode.weight, 2) for mode in belief_of(poses, weights, Symmetry()).modes] == [0.6, 0.4]
    folded = belief_of(poses, weights, Symmetry(np.stack([np.eye(4), HALF_TURN])))
    (mode,) = folded.modes
    assert mode.weight == pytest.approx(1)
    assert np.linalg.norm(mode.pose[:3, 3] - near[1, :3, 3]) < 1e-4  # at the heavier one's side
    np.testing.assert_allclose(folded.weights, weights / weights.sum(), rtol=1e-6)


def test_modes_that_are_no_copies_stay_apart():
    poses = np.concatenate([ring(240)[:3], ring(240)[80:83]])
    belief = belief_of(poses, np.repeat([0.6, 0.4], 3), Symmetry(np.stack([np.eye(4), HALF_TURN])))
    assert [round(mode.weight, 2) for mode in belief.modes] == [0.6, 0.4]


def test_where_an_object_turns_freely_all_around_it_is_one_narrow_mode():
    belief = belief_of(ring(120), np.ones(120), Symmetry(free="axis"))
    (mode,) = belief.modes
    assert mode.weight == pytest.approx(1)
    assert mode.spread_translation < 2e-3
    assert mode.spread_rotation < 0.1
