"""Numbers that nobody should give the filter: each ends in a defined state with a reason.

What lies closer to one module is tested there: weights in test_resampling.py, bad codes and odometry one by one in
test_step.py, books and meshes in test_object_model.py, transforms in transforms/test_buffer.py, stamps that repeat or
run back in nodes/test_time_jumps.py.
"""

import contextlib
import math

import numpy as np
import pytest
from filter_runs import assert_defined, assert_rigid, codes_along, some_book
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.surface import SurfaceConstraint
from midastouch_filter.core.touch import Measurement
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.sensor_model import SensorModel

SMALL = FilterConfig(max_particles=300, min_particles=50, threads=1)
DIM = 64


@pytest.fixture(scope="module")
def filter_(world):
    """With refinement, so that penetrations are looked at, too."""
    book = some_book(world, world.mesh, 1000, sensor="digit_tacto")
    return ParticleFilter(world.mesh, book, SMALL, 0)


# --------------------------------------------------------------------------- starts and half turns


def test_modes_of_particles_a_half_turn_apart_are_rotations(filter_, world):
    filter_.reset(0)
    filter_.initialise_gaussian(world.poses[0], 0.0, 10.0)
    for axis in np.eye(3):
        turn = se3.make(2 * np.outer(axis, axis) - np.eye(3), np.zeros(3))
        assert_defined(filter_, filter_.step(turn, Measurement(False)))


@given(
    arrays(float, 3, elements=st.floats(-1e300, 1e300) | st.floats(-1, 1)),
    st.floats(0, allow_infinity=False) | st.floats(0, 1),
    st.floats(0, allow_infinity=False) | st.floats(0, 1),
)
@settings(max_examples=40)
def test_absurd_priors_are_refused_and_wide_ones_start_on_the_object(filter_, world, where, sigma_t, sigma_r):
    filter_.reset(0)
    prior = se3.translation(where)
    if max(np.abs(where).max() / 2, sigma_t, sigma_r) > 1e3:
        with pytest.raises(InputError, match="prior pose"):
            filter_.initialise_gaussian(prior, sigma_t, sigma_r)
        return
    with contextlib.suppress(InputError):  # just beyond the limit
        filter_.initialise_gaussian(prior, sigma_t, sigma_r)
        assert world.mesh.closest_points(filter_.poses[:, :3, 3])[1].max() < 0.02
        assert_defined(filter_, filter_.step(None, Measurement(True, world.encode(world.poses[:1])[0])))


# --------------------------------------------------------------------------- weights

tops = st.sampled_from([-np.inf, np.inf, np.nan, -1e300, -1e30, 0.0])


@given(tops, tops, st.integers(0, 300))
@settings(max_examples=30)
def test_any_weights_end_in_a_defined_state(filter_, world, most, some, count):
    """All equal, all impossible, all but a few impossible, or no numbers at all."""
    (motion, code), (second_motion, second) = codes_along(world, 2)
    filter_.reset(1)
    filter_.initialise_uniform()
    filter_.step(motion, Measurement(True, code))

    def log_weight(_, particles, codebook_distance):
        out = np.full(len(particles), most)
        out[:count] = some
        return out

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SurfaceConstraint, "log_weight", log_weight)
        estimate = filter_.step(second_motion, Measurement(True, second))
    assert_defined(filter_, estimate)
    usable = np.isfinite(most) if count == 0 else np.isfinite(some) or (count < 300 and np.isfinite(most))
    if not usable:
        assert estimate.status.state == state.LOST
        assert "started again" in estimate.status.reason


@pytest.mark.slow
def test_a_million_particles(world):
    book = some_book(world, world.mesh, 1000)
    many = ParticleFilter(world.mesh, book, FilterConfig(max_particles=1_000_000, threads=1), 0)
    many.initialise_uniform()
    for motion, code in codes_along(world, 2):
        estimate = many.step(motion, Measurement(True, code))
    assert estimate.status.n_particles >= 500
    for mode in estimate.modes:
        assert_rigid(mode.pose)
    assert many.weights.sum() == pytest.approx(1)


# --------------------------------------------------------------------------- codes and penetrations


@given(arrays(np.float64, DIM, elements=st.floats(width=64)), st.integers(0, 5))
@settings(max_examples=50)
def test_any_code_ends_in_a_defined_state(filter_, world, code, spoilt):
    (motion, good), (second_motion, _) = codes_along(world, 2)
    filter_.reset(0)
    filter_.initialise_uniform()
    filter_.step(motion, Measurement(True, good))
    code[: 10 * spoilt] = 0
    estimate = filter_.step(second_motion, Measurement(True, code))
    assert_defined(filter_, estimate)
    with np.errstate(over="ignore"):
        if not np.isfinite(code.astype(np.float32)).all():
            assert "not finite" in estimate.status.reason


MAP_SHAPE = (80, 60)


@pytest.mark.parametrize(
    "penetration",
    [
        np.full(MAP_SHAPE, np.nan, np.float32),
        np.full(MAP_SHAPE, np.inf, np.float32),
        np.full(MAP_SHAPE, 1e30, np.float32),
        np.zeros(MAP_SHAPE, np.float32),
        np.full((160, 120), 1e-3, np.float32),
        np.zeros((0, 0), np.float32),
    ],
    ids=["nan", "inf", "huge", "zero", "wrong size", "empty"],
)
def test_any_penetration_map_ends_in_a_defined_state(filter_, world, penetration):
    frames = codes_along(world, 3)
    truth = world.make_slide(world.mesh, 3, np.random.default_rng(3))
    filter_.reset(0)
    filter_.initialise_gaussian(truth[0], 5e-4, 0.02)
    for motion, code in frames:
        estimate = filter_.step(motion, Measurement(True, code, penetration=penetration))
        assert_defined(filter_, estimate)
    unusable = penetration.shape != MAP_SHAPE or not np.isfinite(penetration).all()
    assert (estimate.status.skipped.get("bad_relief", 0) == 3) == unusable
    assert ("penetration" in estimate.status.reason) == unusable


def test_penetration_maps_have_the_size_of_the_sensors_views():
    assert SensorModel.load("digit_tacto").scaled(0.25).gel_depth.shape == MAP_SHAPE


# --------------------------------------------------------------------------- all in turn

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
def test_nothing_makes_it_say_something_that_is_no_number(filter_, world, sequence, seed):
    rng = np.random.default_rng(seed)
    (_, code), (slid, _) = codes_along(world, 2)
    motions = {
        "slide": slid,
        "rest": np.eye(4),
        "nan": np.full((4, 4), np.nan),
        "jump": se3.exp([10, 0, 0, 0, 0, 0]),
        "spin": se3.exp([0, 0, 0, np.pi, 0, 0]),
        "lift": se3.exp([0, 0, 0.2, 0, 0, 0]),
        "small": se3.exp([1e-9] * 6),
    }
    touches = {
        "touch": code,
        "nan": np.full(64, np.nan),
        "zero": np.zeros(64),
        "short": np.ones(5),
        "air": None,
        "random": rng.standard_normal(64),
        "opposite": -code,
    }
    filter_.reset(seed)
    filter_.initialise_uniform()
    for motion, touch in sequence:
        estimate = filter_.step(motions[motion], Measurement(touch != "air", touches[touch]))
        assert_defined(filter_, estimate)


# --------------------------------------------------------------------------- float32


@given(
    arrays(float, 6, elements=st.floats(-1, 1)),
    arrays(float, 6, elements=st.floats(-1, 1)),
    st.sampled_from([1.0, 1e-2, 1e-4, 0.0]),
)
@settings(max_examples=100)
def test_float32_pose_distance_agrees_with_float64(world, at, step, size):
    """Also where almost equal poses make the scalar product lose its digits."""
    near = se3.exp(at * [0.3, 0.3, 0.3, 3, 3, 3])
    far = near @ se3.exp(size * step * [0.01, 0.01, 0.01, 1, 1, 1])
    lookup = PoseLookup(np.stack([near, near]), Workers(1))
    got = lookup.follow(Particles.from_poses(far[None], np.zeros(1, np.int32)))[0]
    between = se3.inverse(near) @ far
    exact = math.hypot(np.linalg.norm(between[:3, 3]), 0.02 * math.sin(se3.rotation_angle(between[:3, :3]) / 2))
    assert got == pytest.approx(exact, abs=1.5e-5)


@pytest.mark.slow
def test_float32_particles_agree_with_float64_over_a_slide(filter_, world):
    """The whole chain of float32 moves against the same in matrices, without noise."""
    still = FilterConfig(
        noise_translation=0.0, noise_rotation=0.0, noise_per_metre=0.0, noise_per_radian=0.0, max_particles=200,
        min_particles=200, recovery_fraction=0.0, refinement=False, threads=1,
    )  # fmt: skip
    chain = ParticleFilter(world.mesh, some_book(world, world.mesh), still, 0)
    chain.initialise_gaussian(world.poses[0], 0.01, 0.2)
    expected = chain.poses
    for motion, _ in codes_along(world, 200):
        chain.step(motion, Measurement(False))
        if motion is not None:
            expected = expected @ motion
    off = se3.log(se3.inverse(expected) @ chain.poses)
    assert np.abs(off[:, :3]).max() < 1e-5
    assert np.abs(off[:, 3:]).max() < 1e-4
