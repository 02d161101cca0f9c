import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.lookup import PoseLookup, space_filling_order
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers


def distance(a, b):
    """Pose distance of the module's definition, from matrices."""
    angle = se3.rotation_angle(np.swapaxes(a[:, :3, :3], 1, 2) @ b[:, :3, :3])
    return np.hypot(np.linalg.norm(a[:, :3, 3] - b[:, :3, 3], axis=1), 0.02 * np.sin(angle / 2))


@pytest.fixture(scope="module")
def lookup(world):
    return PoseLookup(world.poses, Workers(1))


def test_exact_is_the_nearest_in_the_stated_distance(world, lookup):
    queries = world.random_poses(world.mesh, 50, np.random.default_rng(2))
    brute = [distance(np.repeat(q[None], len(world.poses), axis=0), world.poses).argmin() for q in queries]
    np.testing.assert_array_equal(lookup.exact(queries), brute)


def test_following_agrees_with_the_exact_search(world, lookup):
    rng = np.random.default_rng(4)
    entries = rng.integers(0, len(world.poses), 20_000)
    particles = Particles.from_poses(world.poses[entries], entries)
    # a cloud that has drifted away from the codebook's own poses, in steps of a slide
    for _ in range(10):
        step = se3.exp([1e-3, 1e-3, 0, 0, 0, 0.02]) @ se3.exp(
            rng.normal(size=(20_000, 6)) * np.repeat([5e-4, 0.0175], 3)
        )
        particles = Particles.from_poses(particles.poses @ step, particles.entries)
        found = lookup.follow(particles)
    poses = particles.poses
    exact = lookup.exact(poses)
    nearest = distance(poses, world.poses[exact])
    agrees = (particles.entries == exact) | (found <= 1.01 * nearest + 1e-6)
    assert agrees.mean() >= 0.99
    np.testing.assert_allclose(found, distance(poses, world.poses[particles.entries]), atol=1e-5)


def test_order_along_the_curve_brings_neighbours_together(world):
    order = space_filling_order(world.poses)
    np.testing.assert_array_equal(np.sort(order), np.arange(len(world.poses)))
    jump = np.linalg.norm(np.diff(world.poses[order, :3, 3], axis=0), axis=1)
    assert np.median(jump) < 0.2 * np.median(np.linalg.norm(np.diff(world.poses[:, :3, 3], axis=0), axis=1))


def test_threads_change_nothing(world):
    rng = np.random.default_rng(8)
    entries = rng.integers(0, len(world.poses), 20_000)
    results = []
    for threads in (1, 3):
        particles = Particles.from_poses(world.poses[entries], np.roll(entries, 1))
        found = PoseLookup(world.poses, Workers(threads)).follow(particles)
        results.append((particles.entries.tobytes(), found.tobytes()))
    assert results[0] == results[1]


def test_repeated_poses_are_no_trouble():
    poses = np.repeat(se3.exp([[0.01 * i, 0, 0, 0, 0, 0] for i in range(4)]), 5, axis=0)
    lookup = PoseLookup(poses, Workers(1))
    assert lookup.neighbours.shape == (20, 19)
    assert (lookup.neighbours != np.arange(20)[:, None]).all()


def test_a_book_of_one_pose_is_refused():
    with pytest.raises(InputError, match="1 poses"):
        PoseLookup(np.eye(4)[None], Workers(1))
