"""The whole filter with one finger: what it finds, follows and finds again, what it skips, and what it refuses."""

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest
from filter_runs import assert_defined, error, go_on, hypotheses_at, play, skipped

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import LEAST_UNKNOWN, MOST_UNKNOWN, NoiseModel
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter

FRAME = 1 / 30  # s
AIR = Measurement(False)
UP = se3.translation([0, 0, 0.03])


def converged(estimate, truth):
    """Sure, right and sharp."""
    assert estimate.status.state == state.CONVERGED, estimate.status.reason
    distance, angle = error(estimate, truth)
    assert distance < 1.5e-3
    assert angle < 0.05
    assert estimate.modes[0].weight > 0.98
    return True


@pytest.fixture
def filter_(mapped_slide):
    """Nothing is known."""
    filter_ = mapped_slide.make_filter()
    filter_.initialise_uniform()
    return filter_


@pytest.fixture
def settled(filter_, mapped_slide):
    """It knows the pose, at the last frame of the slide."""
    converged(play(filter_, mapped_slide), mapped_slide.poses[-1])
    return filter_


def test_from_nothing_known_it_converges_in_some_centimetres(filter_, mapped_slide):
    first = play(filter_, mapped_slide, slice(0, 1), FRAME)
    assert first.status.state == state.SEARCHING
    assert set(first.status.ms) == {"motion", "codes", "align", "modes"}
    assert len(filter_.belief) > 1000
    converged(play(filter_, mapped_slide, slice(1, 50), FRAME), mapped_slide.poses[49])
    assert len(filter_.belief) < 500


def test_without_maps_codes_lead_to_the_right_place(coded_slide):
    filter_ = coded_slide.make_filter()
    filter_.initialise_uniform()
    estimate = play(filter_, coded_slide)
    assert error(estimate, coded_slide.poses[-1])[0] < 0.015
    assert error(estimate, coded_slide.poses[-1])[1] < math.radians(20)
    assert estimate.modes[0].weight > 0.8
    assert estimate.modes[0].spread_translation > 2e-3, "codes alone are not as sharp"
    assert estimate.status.state in (state.AMBIGUOUS, state.CONVERGED)


@pytest.mark.parametrize("sigma", [0.5e-3, 0.01])
def test_a_given_pose_is_the_answer_until_something_is_measured(filter_, mapped_slide, sigma):
    given = mapped_slide.poses[60]
    filter_.initialise_gaussian(given, sigma, 20 * sigma)
    estimate = filter_.step(None, AIR)
    assert error(estimate, given)[0] < 0.5 * sigma + 1e-3
    assert estimate.status.state == state.NO_CONTACT
    near = np.linalg.norm(filter_.poses[:, :3, 3] - given[:3, 3], axis=1) < 3 * sigma + 0.012
    assert near.mean() > 0.9
    converged(play(filter_, mapped_slide, slice(60, 100)), mapped_slide.poses[99])


def test_a_start_that_was_wrong_is_overcome(filter_, mapped_slide):
    filter_.initialise_gaussian(mapped_slide.poses[80], 2e-3, 0.05)
    converged(play(filter_, mapped_slide), mapped_slide.poses[-1])


def test_without_a_start_it_says_uninitialised(mapped_slide):
    filter_ = mapped_slide.make_filter()
    estimate = filter_.step(None, mapped_slide.touches[0])
    assert estimate.status.state == state.UNINITIALISED
    assert (estimate.modes, estimate.pose, estimate.covariance) == ([], None, None)
    assert len(filter_.poses) == len(filter_.weights) == 0


def test_from_nothing_known_the_way_to_a_touch_does_not_count(filter_, mapped_slide, world):
    """Wherever the sensor was, it touches the surface; from a pose that is known it does not if it goes past it."""
    down = se3.translation([0.0, 0.0, -5e-3])
    on_surface = []
    for known in (True, False):
        filter_.reset(0)
        if known:
            filter_.initialise_gaussian(world.poses[0], 1e-3, 0.05)
        else:
            filter_.initialise_uniform()
        for _ in range(6):
            filter_.step(down, AIR)
        on_surface.append((world.mesh.closest_points(filter_.poses[:, :3, 3])[1] < 2.2e-3).mean())
    assert on_surface[0] < 0.1
    assert on_surface[1] > 0.9
    converged(play(filter_, mapped_slide, slice(0, 50)), mapped_slide.poses[49])


def test_where_the_gel_was_in_the_air_there_is_no_object(filter_, mapped_slide, world):
    """Before a touch on top of the object it went down beside it, where some poses have the object."""
    top = world.poses_at(world.mesh, np.array([[0, 0, 0.05]]), np.zeros(1), 1e-3)[0]
    beside = se3.make(top[:3, :3], np.array([0.0, 0.042, 0.0]))
    inside = []
    for way in ([top @ UP], [beside @ UP, beside, beside @ UP, top @ UP]):
        filter_.initialise_uniform()
        way = np.stack([way[0], *way, top])
        go_on(filter_, way, [AIR] * (len(way) - 1) + mapped_slide.touches_at(top[None]), FRAME)
        there = filter_.poses @ se3.inverse(top) @ beside
        inside.append((filter_.object.surface.distance(there[:, :3, 3]) < -4e-3).mean())
    assert inside[1] < 0.6 * inside[0]


def test_free_space_counts_more_against_a_pose_known_well(filter_, mapped_slide):
    """Poses of which one finger is 6 mm inside, known to 0.5 mm and to 4 mm; 9 mm outside; 9 mm inside."""
    pose = mapped_slide.poses[0]
    poses = pose @ se3.exp([[0, 0, z, 0, 0, 0] for z in (0.0, 0.0, 0.03, -0.01)])
    free, log_weights = Measurement(False, T_gel_finger=se3.translation([0, 0, -5e-3])), []
    for others in ({}, {"free": free}):
        filter_.initialise_uniform()
        hypotheses = hypotheses_at(poses, np.zeros(4))
        hypotheses.covariances[1] = np.diag(np.repeat([4e-3, 0.1], 3) ** 2)
        filter_.belief.hypotheses = hypotheses
        filter_.step(None, mapped_slide.touches[0], others, elapsed=FRAME)
        log_weights.append(filter_.belief.hypotheses.log_weights)
    sharp, vague, outside, deep = log_weights[1] - log_weights[0]
    floor = NoiseModel.of(FilterConfig()).prior_floor
    assert sharp - outside < vague - outside - 2 < -3
    assert deep - outside == pytest.approx(floor)
    assert sharp - outside > floor - 1e-6


def bits(filter_, slide, frames=12, deferred=False):
    """Digest of all estimates, of a start from nothing known."""
    filter_.initialise_uniform()
    digest = hashlib.sha256()
    for k in range(frames):
        estimate = play(filter_, slide, slice(k, k + 1), FRAME)
        parts = [filter_.poses, filter_.weights, estimate.covariance]
        parts += [part for mode in estimate.modes for part in (mode.pose, mode.covariance)]
        for part in parts:
            digest.update(np.ascontiguousarray(part).tobytes())
        if deferred:
            filter_.deferred_update()
    return digest.hexdigest()


def test_a_reset_threads_and_deferred_updates_change_no_bit(mapped_slide):
    fresh = mapped_slide.make_filter(mapped_slide.codebook)
    first = bits(fresh, mapped_slide)
    fresh.reset(0)
    digests = {first, bits(fresh, mapped_slide, deferred=True)}
    digests.add(bits(mapped_slide.make_filter(threads=8), mapped_slide))
    assert len(digests) == 1


def test_another_seed_draws_other_poses_from_the_same_answer(mapped_slide):
    estimates, draws = [], []
    for seed in (0, 1):
        filter_ = mapped_slide.make_filter(seed=seed)
        filter_.initialise_uniform()
        estimates.append(play(filter_, mapped_slide, slice(0, 8)))
        draws.append(filter_.poses)
    np.testing.assert_array_equal(estimates[0].pose, estimates[1].pose)
    assert not np.array_equal(*draws)


def test_what_is_done_in_a_frame_is_bounded_by_its_time(mapped_slide):
    rate, done = 300, []
    filter_ = mapped_slide.make_filter(alignments_per_second=rate)
    filter_.initialise_uniform()
    for k in range(20):
        estimate = play(filter_, mapped_slide, slice(k, k + 1), FRAME)
        done.append(skipped(estimate, "promoted"))
    assert np.diff(done).max() <= rate * FRAME
    assert done[-1] > 30


def test_a_machine_too_slow_for_deferred_updates_still_converges(filter_, mapped_slide):
    for k in range(len(mapped_slide.poses)):
        estimate = play(filter_, mapped_slide, slice(k, k + 1), FRAME)
        filter_.deferred_update(in_time=lambda: False)
    converged(estimate, mapped_slide.poses[-1])


def test_at_rest_nothing_changes_and_is_counted(settled, mapped_slide):
    settled.step(np.eye(4), mapped_slide.touches[-1])
    poses, again = settled.poses, mapped_slide.touches_at(mapped_slide.poses[-1:] @ se3.translation([0, 0, -1e-5]))[0]
    before = skipped(settled.step(np.eye(4), again), "at_rest")
    for _ in range(20):
        estimate = settled.step(np.eye(4), again)
    np.testing.assert_array_equal(settled.poses, poses)
    assert skipped(estimate, "at_rest") - before == 20


def test_motions_too_small_to_count_add_up(filter_, mapped_slide):
    play(filter_, mapped_slide, slice(0, 10))
    before = skipped(filter_.step(np.eye(4), mapped_slide.touches[9]), "at_rest")
    small = se3.translation([1e-5, 0, 0])
    for k in range(50):
        estimate = filter_.step(small, mapped_slide.touches[10 + k % 2])
    assert 40 < skipped(estimate, "at_rest") - before < 50


def test_an_image_that_comes_again_is_not_looked_at_again(filter_, mapped_slide):
    play(filter_, mapped_slide, slice(0, 10))
    estimate = filter_.step(mapped_slide.odometry[10], mapped_slide.touches[9])
    assert skipped(estimate, "unchanged_code") == 1


def test_open_gates_skip_nothing(mapped_slide, world):
    gates = ("at_rest", "unchanged_code")
    filter_ = ParticleFilter(world.mesh, mapped_slide.codebook, FilterConfig(threads=1), open_gates=gates)
    filter_.initialise_gaussian(mapped_slide.poses[0], 1e-3, 0.02)
    play(filter_, mapped_slide, slice(0, 2))
    before = skipped(filter_.step(np.eye(4), mapped_slide.touches[1]), "descents")
    estimate = filter_.step(np.eye(4), mapped_slide.touches[1])
    assert skipped(estimate, "descents") > before
    assert [skipped(estimate, gate) for gate in gates] == [0, 0]


def test_a_forced_update_counts_although_the_arm_rests(filter_, mapped_slide):
    before = play(filter_, mapped_slide, slice(0, 10))
    filter_.force_update()
    estimate = filter_.step(np.eye(4), mapped_slide.touches[9])
    assert skipped(estimate, "keyframes") == skipped(before, "keyframes") + 1


def test_in_the_air_hypotheses_only_move_with_the_arm(filter_, mapped_slide):
    play(filter_, mapped_slide, slice(0, 5))
    filter_.deferred_update()
    before = filter_.poses
    lift = se3.exp([0, 0, 0.03, 0, 0, 0.4])
    estimate = filter_.step(lift, AIR)
    np.testing.assert_allclose(filter_.poses, before @ lift, atol=1e-6)
    assert estimate.status.state == state.NO_CONTACT
    assert skipped(estimate, "no_contact") == 1


def test_lifted_and_set_down_again_it_is_still_known(settled, mapped_slide):
    here = mapped_slide.poses[-1]
    there = here @ se3.translation([0, 0, 1e-4])
    touches = [AIR, AIR, AIR, *mapped_slide.touches_at(there[None])]
    estimates = go_on(settled, np.stack([here, here @ UP, there @ UP, there]), touches)
    assert [each.status.state for each in estimates[:2]] == [state.NO_CONTACT] * 2
    assert error(estimates[-1], there)[0] < 2e-3
    assert estimates[-1].modes[0].weight > 0.5
    assert skipped(estimates[-1], "born") == 1


def test_an_object_that_was_moved_while_lifted_is_found_again(settled, mapped_slide, world):
    """Nobody says so: the sensor comes down where it went up, and touches another place."""
    here = mapped_slide.poses[-1]
    there = world.make_slide(world.mesh, 60, np.random.default_rng(5))
    go_on(settled, np.stack([here, here @ UP]), [AIR, AIR])
    settled.step(se3.inverse(UP), mapped_slide.touches_at(there[:1])[0], elapsed=FRAME)
    estimates = go_on(settled, there, mapped_slide.touches_at(there), FRAME)
    converged(estimates[-1], there[-1])
    wrong = [each for each, pose in zip(estimates, there[1:], strict=True)
             if each.status.state == state.CONVERGED and error(each, pose)[0] > 0.01]  # fmt: skip
    assert len(wrong) < 5


def test_a_push_is_followed(filter_, mapped_slide):
    play(filter_, mapped_slide, slice(0, 60))
    here = mapped_slide.poses[59]
    push = here @ se3.exp([4e-3, -3e-3, 0, 0, 0, 0.05]) @ se3.inverse(here)
    poses = np.concatenate([[push @ here], push @ mapped_slide.poses[60:]])
    estimates = go_on(filter_, poses, mapped_slide.touches_at(poses), FRAME)
    assert max(error(each, pose)[0] for each, pose in zip(estimates, poses[1:], strict=True)) < 0.01
    converged(estimates[-1], poses[-1])


def test_an_object_moved_under_the_gel_is_found_again(settled, mapped_slide, world):
    """Without a lift; its surface is so smooth that the old pose still explains much of the maps."""
    there = world.make_slide(world.mesh, 60, np.random.default_rng(5))
    before = skipped(settled.step(None, mapped_slide.touches_at(there[:1])[0], elapsed=FRAME), "born")
    estimates = go_on(settled, there, mapped_slide.touches_at(there), FRAME)
    assert skipped(estimates[-1], "born") > before
    converged(estimates[-1], there[-1])


def test_touches_that_no_hypothesis_explains_make_it_lost(settled, mapped_slide, shelf):
    _, frames = shelf.touches(1, 60)
    touches = [replace(mapped_slide.touches[0], penetration=touch.penetration) for _, touch in frames[:6]]
    statuses = [settled.step(mapped_slide.odometry[1], touch, elapsed=FRAME).status for touch in touches]
    lost = [status for status in statuses if status.state == state.LOST]
    assert lost
    assert max(status.likelihood_trend for status in lost) < 0


def test_an_arm_that_errs_makes_no_object_a_foreign_one(filter_, mapped_slide):
    """Late, and with a tool that is off."""
    mount, refused = se3.exp([2e-3, 0, 0, 0, 0.03, 0.03]), []
    late = [None, None, *mapped_slide.odometry[1:-1]]
    off = [None, *(se3.inverse(mount) @ motion @ mount for motion in mapped_slide.odometry[1:])]
    for motions in (late, off):
        filter_.initialise_uniform()
        for motion, touch in zip(motions, mapped_slide.touches, strict=True):
            filter_.step(motion, touch, elapsed=FRAME)
            refused.append(filter_.identity[1])
        assert refused[-1] < 0.3
    assert max(refused) < 0.8


def test_an_object_that_was_refused_is_believed_again(settled, mapped_slide):
    """However much spoke against it; so does one that was believed not stay so."""
    unknown = []
    for support in (-50.0, 50.0):
        settled.belief.support = np.array([support])
        for _ in range(3):
            back = se3.inverse(mapped_slide.poses[-1]) @ mapped_slide.poses[0]
            for motion in (UP, se3.inverse(UP) @ back @ UP):
                settled.step(motion, AIR)
            settled.step(se3.inverse(UP), mapped_slide.touches[0], elapsed=FRAME)
            for k in range(1, 120):
                settled.step(mapped_slide.odometry[k], mapped_slide.touches[k], elapsed=FRAME)
                unknown.append(settled.identity[1])
    refused, believed = np.split(np.array(unknown), 2)
    assert MOST_UNKNOWN >= refused.max() > 0.9
    assert refused[-1] < 0.5
    assert believed.min() >= LEAST_UNKNOWN - 1e-9


def test_ten_metres_of_odometry_start_it_again(settled, mapped_slide):
    estimate = settled.step(se3.exp([10, 0, 0, 0, 0, 0]), mapped_slide.touches[0])
    assert estimate.status.state == state.LOST
    assert "10.00 m" in estimate.status.reason
    assert np.abs(settled.poses[:, :3, 3]).max() < 0.2
    converged(play(settled, mapped_slide, slice(1, 50)), mapped_slide.poses[49])


def test_on_another_object_it_is_not_sure(filter_, shelf):
    """Of a slide over one that it has no mesh of."""
    _, frames = shelf.touches(1, 60)
    codes = filter_.object.measurement.codes
    for k, (motion, touch) in enumerate(frames):
        code = codes[np.random.default_rng(k).integers(len(codes))]
        estimate = filter_.step(motion, Measurement(True, code, penetration=touch.penetration), elapsed=FRAME)
        assert estimate.status.state != state.CONVERGED
    assert_defined(filter_, estimate)


@pytest.mark.parametrize(
    ("kind", "value", "reason"),
    [
        ("bad_code", np.full(64, np.nan), "not finite"),
        ("bad_code", np.ones(128), "length 128"),
        ("bad_code", None, "no code"),
        ("bad_relief", np.full((80, 60), np.nan, np.float32), "penetration map"),
        ("bad_odometry", np.full((4, 4), np.nan), "not finite"),
        ("bad_odometry", np.eye(3), "shape"),
        ("bad_odometry", np.zeros((4, 4)), "rigid"),
        ("bad_odometry", np.diag([1.0, 1, -1, 1]), "rigid"),
    ],
)
def test_bad_input_is_refused_with_a_reason_and_counted(filter_, mapped_slide, kind, value, reason):
    """It changes no more than the frame that it is of."""
    play(filter_, mapped_slide, slice(0, 5))
    filter_.deferred_update()
    before, touch, motion = filter_.poses, mapped_slide.touches[5], mapped_slide.odometry[5]
    if kind == "bad_odometry":
        estimate = filter_.step(value, mapped_slide.touches[4])
        np.testing.assert_array_equal(filter_.poses, before)
    else:
        bad = {"bad_code": "code", "bad_relief": "penetration"}[kind]
        estimate = filter_.step(motion, replace(touch, **{bad: value}))
        np.testing.assert_allclose(filter_.poses, before @ motion, atol=1e-6)
    assert reason in estimate.status.reason
    assert skipped(estimate, kind) == 1
    assert_defined(filter_, estimate)


def test_a_code_of_another_network_stops_at_once(filter_, mapped_slide, world):
    touch = mapped_slide.touches[0]
    with pytest.raises(InputError, match=r"other-net.*fourier-test"):
        filter_.step(None, Measurement(True, touch.code, network_id="other-net", penetration=touch.penetration))
    filter_.step(None, Measurement(True, touch.code, network_id=world.codebook.meta["tcn"]))


@pytest.mark.parametrize(("length", "reason"), [(0.7, "jumped by 0.70 m"), (700.0, "m; is TF in millimetres")])
def test_a_jump_is_named_once_and_metres_are_suspected(settled, length, reason):
    touch = replace(AIR, in_contact=False)
    estimate = settled.step(se3.translation([length, 0, 0]), touch)
    assert "touches nothing" in estimate.status.reason
    assert reason in estimate.status.reason
    assert estimate.status.reason.count("jumped") == 1
