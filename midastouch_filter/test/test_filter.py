import hashlib
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from midastouch_filter import state
from midastouch_filter.config import FilterConfig
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.touch import Measurement
from midastouch_perception import se3
from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh

# without penetrations a mode is as wide as the entries of its book are apart, here some 5 mm
CONFIG = FilterConfig(max_particles=5000, min_particles=300, converged_translation=7e-3)


@pytest.fixture(scope="module")
def start(world):
    """Function that gives a filter of the config, as if made anew with the seed; building one takes a second."""
    made = {}

    def make(config=CONFIG, seed=0):
        if config not in made:
            made[config] = ParticleFilter(world.mesh, world.codebook, config, seed)
        made[config].reset(seed)
        return made[config]

    return make


@pytest.fixture(scope="module")
def slide(world):
    """True poses, odometry from measured poses (0.5 mm, 1 deg, as YCB-Slide's) and touches of one slide."""
    rng = np.random.default_rng(12)
    truth = world.make_slide(world.mesh, 100, rng)
    measured = world.with_pose_noise(truth, rng, 5e-4, math.radians(1.0))
    codes = world.encode(truth)
    return truth, world.odometry_of(measured), [Measurement(True, c, 1e-4) for c in codes]


def play(filter_, slide, frames=slice(None)):
    _, odometry, touches = slide
    for motion, touch in list(zip(odometry, touches, strict=True))[frames]:
        estimate = filter_.step(motion, touch)
    return estimate


def error(estimate, truth):
    between = se3.inverse(truth) @ estimate.pose
    return np.linalg.norm(between[:3, 3]), se3.rotation_angle(between[:3, :3])


def assert_finite(filter_, estimate):
    assert np.isfinite(filter_.poses).all()
    assert np.isfinite(filter_.weights).all()
    assert filter_.weights.sum() == pytest.approx(1)
    assert len(filter_.weights) == len(filter_.poses) == len(filter_.codebook_indices)
    assert np.isfinite(estimate.pose).all()
    assert np.isfinite(estimate.covariance).all()
    status = estimate.status
    assert status.state in state.STATES
    assert status.reason
    for value in (status.ess, status.mode_mass, status.spread_t, status.spread_r, status.likelihood_trend):
        assert math.isfinite(value)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_from_anywhere_to_the_right_mode(start, slide, seed):
    filter_ = start(seed=seed)
    filter_.initialise_uniform()
    estimate = play(filter_, slide)
    distance, angle = error(estimate, slide[0][-1])
    assert distance < 5e-3
    assert angle < math.radians(15)
    assert estimate.status.state == state.CONVERGED, estimate.status.reason
    assert estimate.status.n_particles < CONFIG.max_particles / 2
    assert estimate.modes[0].weight > 0.9


def test_from_the_papers_prior_to_the_right_mode(start, slide, world):
    filter_ = start()
    filter_.initialise_gaussian(slide[0][0], world.mesh.diagonal / 3, math.radians(60))
    assert error(play(filter_, slide), slide[0][-1])[0] < 5e-3


def test_starts_spread_out_and_on_the_surface(start, world):
    filter_ = start()
    filter_.initialise_uniform()
    distance = world.mesh.closest_points(filter_.poses[:, :3, 3])[1]
    assert len(filter_.poses) == CONFIG.max_particles
    assert np.quantile(distance, 0.95) < 2.2e-3
    filter_.initialise_gaussian(world.poses[0], 0.02, 0.1)
    assert np.quantile(world.mesh.closest_points(filter_.poses[:, :3, 3])[1], 0.95) < 2.2e-3
    assert len(np.unique(filter_.poses[:, 0, 3])) > 0.99 * CONFIG.max_particles


def test_a_symmetric_object_keeps_both_answers(world):
    """An ellipsoid, and codes that cannot tell a pose from the one turned by 180 degrees about its z axis."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = ObjectMesh.from_arrays(ball.vertices * [0.05, 0.035, 0.025], ball.faces, "ellipsoid")
    turn = np.diag([-1.0, -1, 1, 1])

    def encode(poses):
        codes = world.encode(poses) + world.encode(turn @ poses)
        return codes / np.linalg.norm(codes, axis=1, keepdims=True)

    poses = world.random_poses(mesh, 4000, np.random.default_rng(0))
    poses = np.concatenate([poses, turn @ poses])
    filter_ = ParticleFilter(mesh, world.make_codebook(poses, encode(poses)), CONFIG, 0)
    filter_.initialise_uniform()
    truth = world.make_slide(mesh, 50, np.random.default_rng(4))
    for motion, code in zip(world.odometry_of(truth), encode(truth), strict=True):
        estimate = filter_.step(motion, Measurement(True, code))
    for answer in (truth[-1], turn @ truth[-1]):
        assert min(np.linalg.norm(m.pose[:3, 3] - answer[:3, 3]) for m in estimate.modes) < 5e-3
    assert estimate.status.state == state.AMBIGUOUS
    assert estimate.status.n_modes >= 2


def test_same_seed_same_bits(world, slide, start):
    """Also after a reset, and whatever the number of threads."""
    digests = set()
    one, two = (FilterConfig(max_particles=10_000, threads=threads) for threads in (1, 2))
    fresh = ParticleFilter(world.mesh, world.codebook, one, 3)
    for make in (lambda: fresh, lambda: start(two, seed=3), lambda: start(two, seed=3)):
        filter_ = make()
        filter_.initialise_uniform()
        estimate = play(filter_, slide, slice(0, 25))
        content = [filter_.poses, filter_.weights, filter_.codebook_indices, estimate.pose, estimate.covariance]
        digests.add(hashlib.sha256(b"".join(a.tobytes() for a in content)).hexdigest())
    assert len(digests) == 1


def test_another_seed_other_bits(start, slide):
    poses = []
    for seed in (0, 1):
        filter_ = start(seed=seed)
        filter_.initialise_uniform()
        play(filter_, slide, slice(0, 3))
        poses.append(filter_.poses.tobytes())
    assert poses[0] != poses[1]


def test_without_a_start_it_says_uninitialised(start, slide):
    estimate = start().step(None, slide[2][0])
    assert estimate.status.state == state.UNINITIALISED
    assert estimate.modes == []
    assert estimate.pose is None
    assert estimate.covariance is None


# --------------------------------------------------------------------------- gates


def skipped(estimate, name):
    return estimate.status.skipped.get(name, 0)


def test_at_rest_nothing_changes(start, slide):
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide, slice(0, 10))
    before = filter_.poses.copy(), filter_.weights.copy()
    rng = np.random.default_rng(0)
    code = slide[2][9].code
    for _ in range(20):
        noisy = code + 1e-3 * rng.standard_normal(64).astype(np.float32)
        estimate = filter_.step(np.eye(4), Measurement(True, noisy))
    np.testing.assert_array_equal(filter_.poses, before[0])
    np.testing.assert_array_equal(filter_.weights, before[1])
    assert skipped(estimate, "at_rest") == 20
    assert skipped(estimate, "unmoved_modes") == 20


def test_a_forced_update_counts_although_the_arm_rests(start, slide):
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide, slice(0, 10))
    before = filter_.weights.copy()
    filter_.force_update()
    filter_.step(np.eye(4), slide[2][9])
    assert not np.array_equal(filter_.weights, before)


def test_in_the_air_particles_move_with_the_arm_and_nothing_else(start, slide):
    filter_ = start(FilterConfig(max_particles=2000, noise_per_metre=0.0, noise_per_radian=0.0))
    filter_.initialise_uniform()
    play(filter_, slide, slice(0, 5))
    before, weights = filter_.poses, filter_.weights.copy()
    lift = se3.exp([0, 0, 0.03, 0, 0, 0.4])
    estimate = filter_.step(lift, Measurement(False))
    np.testing.assert_allclose(filter_.poses, before @ lift, atol=1e-6)
    np.testing.assert_array_equal(filter_.weights, weights)
    assert estimate.status.state == state.NO_CONTACT
    assert skipped(estimate, "no_contact") == 1


def test_a_repeated_code_is_not_counted_again(start, slide):
    filter_ = start()
    filter_.initialise_uniform()
    filter_.step(None, slide[2][0])
    weights = filter_.weights.copy()
    estimate = filter_.step(slide[1][1], slide[2][0])
    np.testing.assert_array_equal(filter_.weights, weights)
    assert skipped(estimate, "unchanged_code") == 1


def test_a_converged_filter_skips_work(slide, start):
    filter_ = start()
    filter_.initialise_uniform()
    estimate = play(filter_, slide)
    assert skipped(estimate, "whole_book") > 0
    assert skipped(estimate, "effective_size") > 0


def test_a_narrow_belief_drops_surplus_particles_though_its_weights_are_even(world, slide):
    config = replace(CONFIG, resample_ess=0.0, max_particles=4000, min_particles=100)
    filter_ = ParticleFilter(world.mesh, world.codebook, config)
    filter_.initialise_gaussian(slide[0][0], 1e-3, 0.05)
    estimate = filter_.step(None, slide[2][0])
    assert estimate.status.n_particles < 2000


def test_stages_are_timed_by_the_given_clock(world, slide):
    ticks = iter(range(10_000))
    filter_ = ParticleFilter(world.mesh, world.codebook, CONFIG, clock=lambda: float(next(ticks)))
    filter_.initialise_uniform()
    estimate = filter_.step(None, slide[2][0])
    assert set(estimate.status.ms) == {"motion", "lookup", "weights", "resampling", "modes"}
    assert all(ms == 1000.0 for ms in estimate.status.ms.values())


# --------------------------------------------------------------------------- recovery


def test_finds_back_after_being_carried_away(start, slide, world):
    """Converged, then the sensor is elsewhere without the odometry telling."""
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide)
    elsewhere = world.make_slide(world.mesh, 90, np.random.default_rng(77))
    states = []
    for motion, code in zip(world.odometry_of(elsewhere), world.encode(elsewhere), strict=True):
        estimate = filter_.step(motion, Measurement(True, code))
        states.append(estimate.status.state)
    # noticed within two correlation lengths of sliding
    assert any(s != state.CONVERGED for s in states[:20])
    assert states[-1] == state.CONVERGED
    assert error(estimate, elsewhere[-1])[0] < 5e-3
    assert skipped(estimate, "injected") + skipped(estimate, "restarted") > 0


def test_lift_move_and_touch_again(start, slide, world):
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide)
    here = slide[0][-1]
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


def test_particles_that_all_left_the_surface_start_again(start, slide, world):
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide, slice(0, 20))
    # into the air by a hand's width, yet the sensor claims to touch
    estimate = filter_.step(se3.exp([0, 0, 0.1, 0, 0, 0]), slide[2][0])
    assert estimate.status.state == state.LOST
    assert "started again" in estimate.status.reason
    assert estimate.status.n_particles == CONFIG.max_particles
    assert_finite(filter_, estimate)


# --------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (np.full(64, np.nan), "not finite"),
        (np.full(64, np.inf), "not finite"),
        (np.zeros(64), "zero"),
        (np.ones(128), "length 128"),
        (None, "no code"),
    ],
)
def test_bad_codes_are_refused_with_a_reason_and_counted(start, slide, code, reason):
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide, slice(0, 5))
    weights = filter_.weights.copy()
    estimate = filter_.step(slide[1][5], Measurement(True, code))
    np.testing.assert_array_equal(filter_.weights, weights)
    assert reason in estimate.status.reason
    assert skipped(estimate, "bad_code") == 1
    assert_finite(filter_, estimate)


@pytest.mark.parametrize(
    ("odometry", "reason"),
    [(np.full((4, 4), np.nan), "not finite"), (np.eye(3), "shape"), (np.zeros((4, 4)), "rigid")],
)
def test_bad_odometry_is_refused_with_a_reason_and_counted(start, slide, odometry, reason):
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide, slice(0, 5))
    poses = filter_.poses
    estimate = filter_.step(odometry, slide[2][5])
    np.testing.assert_array_equal(filter_.poses, poses)
    assert reason in estimate.status.reason
    assert skipped(estimate, "bad_odometry") == 1
    assert_finite(filter_, estimate)


def test_ten_metres_of_odometry_start_the_filter_again(start, slide):
    filter_ = start()
    filter_.initialise_uniform()
    play(filter_, slide)
    estimate = filter_.step(se3.exp([10, 0, 0, 0, 0, 0]), slide[2][0])
    assert estimate.status.state == state.LOST
    assert "10.00 m" in estimate.status.reason
    assert np.abs(filter_.poses[:, :3, 3]).max() < 0.2
    assert_finite(filter_, estimate)


def test_a_code_of_another_network_stops_at_once(start, slide, world):
    filter_ = start()
    filter_.initialise_uniform()
    with pytest.raises(InputError, match=r"other-net.*fourier-test"):
        filter_.step(None, Measurement(True, slide[2][0].code, network_id="other-net"))
    filter_.step(None, Measurement(True, slide[2][0].code, network_id=world.codebook.meta["tcn"]))


@pytest.mark.parametrize(
    ("prior", "sigma_t", "sigma_r"),
    [(np.full((4, 4), np.nan), 0.01, 0.1), (np.eye(4), -1.0, 0.1), (np.eye(4), 0.01, np.inf), (2 * np.eye(4), 1, 1)],
)
def test_bad_priors_are_named(start, prior, sigma_t, sigma_r):
    with pytest.raises(InputError, match="prior pose"):
        start().initialise_gaussian(prior, sigma_t, sigma_r)


@pytest.mark.parametrize("n", [1, 2, 60_000])
def test_any_number_of_particles(start, slide, n):
    filter_ = start(FilterConfig(min_particles=1, max_particles=n))
    filter_.initialise_uniform()
    estimate = play(filter_, slide, slice(0, 4))
    assert_finite(filter_, estimate)


def test_a_book_with_nan_poses_is_refused(world):
    poses = world.poses.copy()
    poses[5, 0, 3] = np.nan
    with pytest.raises(InputError, match="poses are not finite"):
        ParticleFilter(world.mesh, world.make_codebook(poses, world.codebook.codes), CONFIG)


def test_stale_is_said_until_the_next_step(start, slide):
    filter_ = start()
    assert filter_.mark_stale("no transform for 2 s").state == state.STALE
    filter_.initialise_uniform()
    filter_.step(None, slide[2][0])
    status = filter_.mark_stale("no code for 3 s")
    assert (status.state, status.reason) == (state.STALE, "no code for 3 s")
    assert filter_.step(slide[1][1], slide[2][1]).status.state != state.STALE


actions = st.lists(
    st.tuples(
        st.sampled_from(["slide", "rest", "nan", "jump", "spin", "lift", "small"]),
        st.sampled_from(["touch", "nan", "zero", "short", "air", "random", "opposite"]),
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=25)
@given(actions, st.integers(0, 1000))
def test_nothing_makes_it_say_something_that_is_no_number(slide, stressed, sequence, seed):
    rng = np.random.default_rng(seed)
    motions = {
        "slide": slide[1][1],
        "rest": np.eye(4),
        "nan": np.full((4, 4), np.nan),
        "jump": se3.exp([10, 0, 0, 0, 0, 0]),
        "spin": se3.exp([0, 0, 0, np.pi, 0, 0]),
        "lift": se3.exp([0, 0, 0.2, 0, 0, 0]),
        "small": se3.exp([1e-9] * 6),
    }
    code = slide[2][0].code
    touches = {
        "touch": code,
        "nan": np.full(64, np.nan),
        "zero": np.zeros(64),
        "short": np.ones(5),
        "air": None,
        "random": rng.standard_normal(64),
        "opposite": -code,
    }
    stressed.initialise_uniform()
    for motion, touch in sequence:
        estimate = stressed.step(motions[motion], Measurement(touch != "air", touches[touch]))
        assert_finite(stressed, estimate)


@pytest.fixture(scope="module")
def stressed(world):
    return ParticleFilter(world.mesh, world.codebook, FilterConfig(max_particles=1000, min_particles=50), 0)
