import hashlib
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from filter_runs import assert_defined, error, play, skipped

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_from_anywhere_to_the_right_mode(coded_slide, seed):
    filter_ = coded_slide.make_filter(seed=seed)
    filter_.initialise_uniform()
    estimate = play(filter_, coded_slide)
    distance, angle = error(estimate, coded_slide.poses[-1])
    assert distance < 5e-3
    assert angle < math.radians(15)
    assert estimate.status.state == state.CONVERGED, estimate.status.reason
    assert estimate.status.n_particles < coded_slide.config.max_particles / 2
    assert estimate.modes[0].weight > 0.9


def test_from_the_papers_prior_to_the_right_mode(coded_slide, world):
    filter_ = coded_slide.make_filter()
    filter_.initialise_gaussian(coded_slide.poses[0], world.mesh.diagonal / 3, math.radians(60))
    assert error(play(filter_, coded_slide), coded_slide.poses[-1])[0] < 5e-3


def test_starts_spread_out_and_on_the_surface(coded_slide, world):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    distance = world.mesh.closest_points(filter_.poses[:, :3, 3])[1]
    assert len(filter_.poses) == coded_slide.config.max_particles
    assert np.quantile(distance, 0.95) < 2.2e-3
    filter_.initialise_gaussian(world.poses[0], 0.02, 0.1)
    assert np.quantile(world.mesh.closest_points(filter_.poses[:, :3, 3])[1], 0.95) < 2.2e-3
    assert len(np.unique(filter_.poses[:, 0, 3])) > 0.99 * coded_slide.config.max_particles


def test_from_nothing_known_the_way_through_the_air_to_the_first_touch_says_nothing(coded_slide, world):
    """Wherever the sensor was, it touches the surface; from a pose that is known it does not if it goes past it."""
    down, air = se3.translation([0.0, 0.0, -5e-3]), Measurement(False, None)
    for known in (False, True):
        filter_ = coded_slide.make_filter()
        if known:
            filter_.initialise_gaussian(world.poses[0], 1e-3, 0.05)
        else:
            filter_.initialise_uniform()
        for _ in range(6):
            filter_.step(down, air)
        distance = world.mesh.closest_points(filter_.poses[:, :3, 3])[1]
        on_surface = (distance < 2.2e-3).mean()
        assert on_surface < 0.05 if known else on_surface > 0.9
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    for _ in range(6):
        filter_.step(down, air)
    assert error(play(filter_, coded_slide), coded_slide.poses[-1])[0] < 5e-3


def test_a_symmetric_object_keeps_both_answers(world, coded_slide):
    """An ellipsoid, and codes that cannot tell a pose from the one turned by 180 degrees about its z axis."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = ObjectMesh.from_arrays(ball.vertices * [0.05, 0.035, 0.025], ball.faces, "ellipsoid")
    turn = np.diag([-1.0, -1, 1, 1])

    def encode(poses):
        codes = world.encode(poses) + world.encode(turn @ poses)
        return codes / np.linalg.norm(codes, axis=1, keepdims=True)

    poses = world.random_poses(mesh, 4000, np.random.default_rng(0))
    poses = np.concatenate([poses, turn @ poses])
    filter_ = ParticleFilter(mesh, world.make_codebook(poses, encode(poses)), coded_slide.config, 0)
    filter_.initialise_uniform()
    truth = world.make_slide(mesh, 50, np.random.default_rng(4))
    for motion, code in zip(se3.odometry(truth), encode(truth), strict=True):
        estimate = filter_.step(motion, Measurement(True, code))
    for answer in (truth[-1], turn @ truth[-1]):
        assert min(np.linalg.norm(m.pose[:3, 3] - answer[:3, 3]) for m in estimate.modes) < 5e-3
    assert estimate.status.state == state.AMBIGUOUS
    assert estimate.status.n_modes >= 2


def test_same_seed_same_bits(world, coded_slide):
    """Also after a reset, and whatever the number of threads."""
    digests = set()
    one, two = (FilterConfig(max_particles=10_000, threads=threads) for threads in (1, 2))
    fresh = ParticleFilter(world.mesh, world.codebook, one, 3)
    for make in (
        lambda: fresh,
        lambda: coded_slide.make_filter(two, seed=3),
        lambda: coded_slide.make_filter(two, seed=3),
    ):
        filter_ = make()
        filter_.initialise_uniform()
        estimate = play(filter_, coded_slide, slice(0, 25))
        content = [filter_.poses, filter_.weights, filter_.codebook_indices, estimate.pose, estimate.covariance]
        digests.add(hashlib.sha256(b"".join(a.tobytes() for a in content)).hexdigest())
    assert len(digests) == 1


def test_another_seed_other_bits(coded_slide):
    poses = []
    for seed in (0, 1):
        filter_ = coded_slide.make_filter(seed=seed)
        filter_.initialise_uniform()
        play(filter_, coded_slide, slice(0, 3))
        poses.append(filter_.poses.tobytes())
    assert poses[0] != poses[1]


def test_without_a_start_it_says_uninitialised(coded_slide):
    estimate = coded_slide.make_filter().step(None, coded_slide.touches[0])
    assert estimate.status.state == state.UNINITIALISED
    assert estimate.modes == []
    assert estimate.pose is None
    assert estimate.covariance is None


@pytest.mark.parametrize(
    ("prior", "sigma_t", "sigma_r"),
    [(np.full((4, 4), np.nan), 0.01, 0.1), (np.eye(4), -1.0, 0.1), (np.eye(4), 0.01, np.inf), (2 * np.eye(4), 1, 1)],
)
def test_bad_priors_are_named(coded_slide, prior, sigma_t, sigma_r):
    with pytest.raises(InputError, match="prior pose"):
        coded_slide.make_filter().initialise_gaussian(prior, sigma_t, sigma_r)


@pytest.mark.parametrize("n", [1, 2, 60_000])
def test_any_number_of_particles(coded_slide, n):
    filter_ = coded_slide.make_filter(FilterConfig(min_particles=1, max_particles=n))
    filter_.initialise_uniform()
    estimate = play(filter_, coded_slide, slice(0, 4))
    assert_defined(filter_, estimate)


# --------------------------------------------------------------------------- recovery


def test_finds_back_after_being_carried_away(coded_slide, world):
    """Converged, then the sensor is elsewhere without the odometry telling, and there are no maps to tell either."""
    filter_ = coded_slide.make_filter(replace(coded_slide.config, refinement=False))
    filter_.initialise_uniform()
    play(filter_, coded_slide)
    elsewhere = world.make_slide(world.mesh, 90, np.random.default_rng(77))
    states = []
    for motion, code in zip(se3.odometry(elsewhere), world.encode(elsewhere), strict=True):
        estimate = filter_.step(motion, Measurement(True, code))
        states.append(estimate.status.state)
    # noticed within two correlation lengths of sliding
    assert any(s != state.CONVERGED for s in states[:20])
    assert states[-1] == state.CONVERGED
    assert error(estimate, elsewhere[-1])[0] < 5e-3
    assert skipped(estimate, "injected") + skipped(estimate, "restarted") > 0


def test_lift_move_and_touch_again(coded_slide, world):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, coded_slide)
    here = coded_slide.poses[-1]
    there = world.make_slide(world.mesh, 10, np.random.default_rng(5))
    path = [here, here @ se3.exp([0, 0, 0.03, 0, 0, 0]), there[0] @ se3.exp([0, 0, 0.03, 0, 0, 0])]
    estimate = None
    for a, b in pairwise(path):
        estimate = filter_.step(se3.inverse(a) @ b, Measurement(False))
    assert estimate.status.state == state.NO_CONTACT
    for a, b, code in zip([path[-1], *there], there, world.encode(there), strict=False):
        estimate = filter_.step(se3.inverse(a) @ b, Measurement(True, code))
    assert error(estimate, there[-1])[0] < 6e-3
    assert estimate.status.state == state.CONVERGED, estimate.status.reason
