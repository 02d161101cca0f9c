"""What a step skips, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from filter_runs import assert_defined, play, skipped

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter


def test_at_rest_nothing_changes(coded_slide):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, coded_slide, slice(0, 10))
    before = filter_.poses.copy(), filter_.weights.copy()
    rng = np.random.default_rng(0)
    code = coded_slide.touches[9].code
    for _ in range(20):
        noisy = code + 1e-3 * rng.standard_normal(64).astype(np.float32)
        estimate = filter_.step(np.eye(4), Measurement(True, noisy))
    np.testing.assert_array_equal(filter_.poses, before[0])
    np.testing.assert_array_equal(filter_.weights, before[1])
    assert skipped(estimate, "at_rest") == 20


def test_a_forced_update_counts_although_the_arm_rests(coded_slide):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, coded_slide, slice(0, 10))
    before = filter_.weights.copy()
    filter_.force_update()
    filter_.step(np.eye(4), coded_slide.touches[9])
    assert not np.array_equal(filter_.weights, before)


def test_in_the_air_particles_move_with_the_arm_and_nothing_else(coded_slide):
    filter_ = coded_slide.make_filter(FilterConfig(max_particles=2000, noise_per_metre=0.0, noise_per_radian=0.0))
    filter_.initialise_uniform()
    play(filter_, coded_slide, slice(0, 5))
    before, weights = filter_.poses, filter_.weights.copy()
    lift = se3.exp([0, 0, 0.03, 0, 0, 0.4])
    estimate = filter_.step(lift, Measurement(False))
    np.testing.assert_allclose(filter_.poses, before @ lift, atol=1e-6)
    np.testing.assert_array_equal(filter_.weights, weights)
    assert estimate.status.state == state.NO_CONTACT
    assert skipped(estimate, "no_contact") == 1


def test_a_repeated_code_is_not_counted_again(coded_slide):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    filter_.step(None, coded_slide.touches[0])
    weights = filter_.weights.copy()
    estimate = filter_.step(coded_slide.odometry[1], coded_slide.touches[0])
    np.testing.assert_array_equal(filter_.weights, weights)
    assert skipped(estimate, "unchanged_code") == 1


def test_a_narrow_belief_drops_surplus_particles(world, coded_slide):
    config = replace(coded_slide.config, max_particles=4000, min_particles=100)
    filter_ = ParticleFilter(world.mesh, world.codebook, config)
    filter_.initialise_gaussian(coded_slide.poses[0], 1e-3, 0.05)
    estimate = filter_.step(None, coded_slide.touches[0])
    assert estimate.status.n_particles < 2000


def test_stages_are_timed_by_the_given_clock(world, coded_slide):
    ticks = iter(range(10_000))
    filter_ = ParticleFilter(world.mesh, world.codebook, coded_slide.config, clock=lambda: float(next(ticks)))
    filter_.initialise_uniform()
    estimate = filter_.step(None, coded_slide.touches[0])
    assert set(estimate.status.ms) == {"motion", "lookup", "weights", "resampling", "modes"}
    assert all(ms == 1000.0 for ms in estimate.status.ms.values())


def test_particles_that_all_left_the_surface_start_again(coded_slide, world):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, coded_slide, slice(0, 20))
    # into the air by a hand's width, yet the sensor claims to touch
    estimate = filter_.step(se3.exp([0, 0, 0.1, 0, 0, 0]), coded_slide.touches[0])
    assert estimate.status.state == state.LOST
    assert "started again" in estimate.status.reason
    assert estimate.status.n_particles == coded_slide.config.max_particles
    assert_defined(filter_, estimate)


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
def test_bad_codes_are_refused_with_a_reason_and_counted(coded_slide, code, reason):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, coded_slide, slice(0, 5))
    weights = filter_.weights.copy()
    estimate = filter_.step(coded_slide.odometry[5], Measurement(True, code))
    np.testing.assert_array_equal(filter_.weights, weights)
    assert reason in estimate.status.reason
    assert skipped(estimate, "bad_code") == 1
    assert_defined(filter_, estimate)


@pytest.mark.parametrize(
    ("odometry", "reason"),
    [(np.full((4, 4), np.nan), "not finite"), (np.eye(3), "shape"), (np.zeros((4, 4)), "rigid")],
)
def test_bad_odometry_is_refused_with_a_reason_and_counted(coded_slide, odometry, reason):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, coded_slide, slice(0, 5))
    poses = filter_.poses
    estimate = filter_.step(odometry, coded_slide.touches[5])
    np.testing.assert_array_equal(filter_.poses, poses)
    assert reason in estimate.status.reason
    assert skipped(estimate, "bad_odometry") == 1
    assert_defined(filter_, estimate)


def test_ten_metres_of_odometry_start_the_filter_again(coded_slide):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, coded_slide)
    estimate = filter_.step(se3.exp([10, 0, 0, 0, 0, 0]), coded_slide.touches[0])
    assert estimate.status.state == state.LOST
    assert "10.00 m" in estimate.status.reason
    assert np.abs(filter_.poses[:, :3, 3]).max() < 0.2
    assert_defined(filter_, estimate)


def test_a_code_of_another_network_stops_at_once(coded_slide, world):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    with pytest.raises(InputError, match=r"other-net.*fourier-test"):
        filter_.step(None, Measurement(True, coded_slide.touches[0].code, network_id="other-net"))
    filter_.step(None, Measurement(True, coded_slide.touches[0].code, network_id=world.codebook.meta["tcn"]))
