import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_common import se3
from midastouch_filter.core.estimate import modes_from_moments
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.modes import ModeFinder, Regions
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers

WORKERS = Workers(1)


@pytest.fixture(scope="module")
def lookup(world):
    return PoseLookup(world.poses, WORKERS)


@pytest.fixture(scope="module")
def finder(world, lookup):
    return ModeFinder(lookup, Regions(lookup, 0.005), 0.012, 0.01, WORKERS)


def cluster(lookup, centre, n, rng, sigma_t=1e-3, sigma_r=0.03):
    poses = centre @ se3.exp(rng.normal(size=(n, 6)) * np.repeat([sigma_t, sigma_r], 3))
    return Particles.from_poses(poses, lookup.exact(poses))


def merged(*parts):
    poses = np.concatenate([p.poses for p in parts])
    return Particles.from_poses(poses, np.concatenate([p.entries for p in parts]))


def far_apart(world, count):
    """Codebook poses at least 40 mm apart."""
    chosen = [world.poses[0]]
    for pose in world.poses:
        if all(np.linalg.norm(pose[:3, 3] - c[:3, 3]) > 0.04 for c in chosen):
            chosen.append(pose)
        if len(chosen) == count:
            break
    return chosen


def test_regions_cover_the_book_and_are_small(world, lookup):
    regions = Regions(lookup, 0.005)
    assert regions.of_entry.min() == 0
    assert len(np.unique(regions.of_entry)) == len(regions)
    np.testing.assert_array_equal(regions.of_entry[regions.centre], np.arange(len(regions)))
    between = se3.inverse(world.poses) @ world.poses[regions.centre[regions.of_entry]]
    turned = 0.02 * np.sin(se3.rotation_angle(between[:, :3, :3]) / 2)
    apart = np.hypot(np.linalg.norm(between[:, :3, 3], axis=1), turned)
    assert apart.max() <= 0.005 + 1e-6
    source = np.repeat(np.arange(len(regions)), np.diff(regions.start))
    pairs = set(zip(source.tolist(), regions.neighbours.tolist(), strict=True))
    assert pairs == {(b, a) for a, b in pairs}
    assert all(a != b for a, b in pairs)


def test_finds_each_cluster_with_its_mass_and_pose(world, lookup, finder):
    rng = np.random.default_rng(0)
    centres = far_apart(world, 3)
    particles = merged(*[cluster(lookup, c, n, rng) for c, n in zip(centres, (500, 300, 200), strict=True)])
    modes = modes_from_moments(finder.find(particles, np.full(1000, 1e-3)))
    assert [m.n for m in modes] == [500, 300, 200]
    np.testing.assert_allclose([m.weight for m in modes], [0.5, 0.3, 0.2])
    for mode, centre in zip(modes, centres, strict=True):
        error = se3.log(se3.inverse(centre) @ mode.pose)
        assert np.linalg.norm(error[:3]) < 3e-4
        assert np.linalg.norm(error[3:]) < 0.01


def test_poses_that_differ_in_rotation_only_are_two_modes(world, lookup, finder):
    rng = np.random.default_rng(1)
    centre = world.poses[10]
    turned = centre @ se3.exp([0, 0, 0, 0, 0, np.pi])
    particles = merged(cluster(lookup, centre, 600, rng), cluster(lookup, turned, 400, rng))
    modes = modes_from_moments(finder.find(particles, np.full(1000, 1e-3)))
    np.testing.assert_allclose([m.weight for m in modes], [0.6, 0.4], atol=1e-9)


def test_weights_decide_not_numbers(world, lookup, finder):
    rng = np.random.default_rng(2)
    a, b = far_apart(world, 2)
    particles = merged(cluster(lookup, a, 100, rng), cluster(lookup, b, 900, rng))
    weights = np.concatenate([np.full(100, 0.9 / 100), np.full(900, 0.1 / 900)])
    modes = modes_from_moments(finder.find(particles, weights))
    assert modes[0].n == 100
    assert modes[0].weight == pytest.approx(0.9)


def test_specks_are_left_out_but_never_all(world, lookup, finder):
    rng = np.random.default_rng(3)
    a, b = far_apart(world, 2)
    particles = merged(cluster(lookup, a, 995, rng), cluster(lookup, b, 5, rng))
    modes = modes_from_moments(finder.find(particles, np.full(1000, 1e-3)))
    assert len(modes) == 1
    assert modes[0].weight == pytest.approx(0.995)
    scattered = Particles.from_poses(world.poses, np.arange(len(world.poses)))
    modes = modes_from_moments(finder.find(scattered, np.full(len(world.poses), 1 / len(world.poses))))
    assert len(modes) >= 1
    assert sum(m.weight for m in modes) <= 1 + 1e-9


def test_covariance_is_that_of_the_tangent_vectors_about_fixed_object_axes(lookup, finder, world):
    """REP-103: x, y, z, then rotations about the object's own X, Y, Z, not about the moving gel frame's."""
    rng = np.random.default_rng(4)
    centre = world.poses[100]
    factor = np.diag([1e-3, 5e-4, 2e-4, 0.05, 0.02, 0.01]) + np.tril(1e-4 * rng.standard_normal((6, 6)), -1)
    xi = rng.standard_normal((20_000, 6)) @ factor.T
    poses = np.repeat(centre[None], 20_000, axis=0)
    poses[:, :3, 3] += xi[:, :3]
    turn = se3.exp(np.concatenate([np.zeros((20_000, 3)), xi[:, 3:]], axis=1))
    poses[:, :3, :3] = turn[:, :3, :3] @ centre[:3, :3]
    particles = Particles.from_poses(poses, np.full(20_000, 100, np.int32))
    (mode,) = modes_from_moments(finder.find(particles, np.full(20_000, 1 / 20_000)))
    expected = np.cov(xi.T, bias=True)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(mode.covariance / scale, expected / scale, atol=5e-3)
    assert mode.spread_translation == pytest.approx(np.sqrt(np.trace(expected[:3, :3])), rel=1e-2)


@given(st.integers(0, 2**32 - 1), st.integers(2, 40), st.floats(0, 3.2), st.floats(0, 0.02))
def test_covariances_are_finite_symmetric_and_positive(world_of_one_mode, seed, n, sigma_r, sigma_t):
    rng = np.random.default_rng(seed)
    poses = se3.exp(rng.normal(size=(n, 6)) * np.repeat([sigma_t, sigma_r], 3))
    weights = rng.dirichlet(np.ones(n))
    particles = Particles.from_poses(poses, np.zeros(n, np.int32))
    (mode,) = modes_from_moments(world_of_one_mode.find(particles, weights))
    c = mode.covariance
    np.testing.assert_allclose(c, c.T, atol=1e-12)
    assert np.linalg.eigvalsh(c).min() > -1e-7
    assert np.diag(c).min() >= 0
    mean = weights @ poses[:, :3, 3]
    np.testing.assert_allclose(mode.pose[:3, 3], mean, atol=1e-6)
    np.testing.assert_allclose(mode.pose[:3, :3] @ mode.pose[:3, :3].T, np.eye(3), atol=1e-9)


@pytest.fixture(scope="module")
def world_of_one_mode():
    poses = se3.exp([[0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]])
    lookup = PoseLookup(poses, WORKERS)
    return ModeFinder(lookup, Regions(lookup, 0.005), 0.012, 0.01, WORKERS)


def test_threads_change_nothing(world, lookup):
    rng = np.random.default_rng(5)
    particles = cluster(lookup, world.poses[7], 20_000, rng, 4e-3, 0.2)
    weights = rng.dirichlet(np.ones(20_000))
    sums = [
        ModeFinder(lookup, Regions(lookup, 0.005), 0.012, 0.01, Workers(t)).find(particles, weights).square.tobytes()
        for t in (1, 3)
    ]
    assert sums[0] == sums[1]
