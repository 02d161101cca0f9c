"""The filter with several fingers: what they tell, and a gripper that tells what one finger cannot."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.touch import Measurement, reduced_penetration
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.simulation.slide import measure_poses

CONFIG = FilterConfig(max_particles=3000, min_particles=300, threads=1, converged_translation=7e-3)


def touch(T_gel_finger, code=None, **changes):
    return Measurement(code is not None, code, T_gel_finger=T_gel_finger, **changes)


@pytest.fixture(scope="module")
def pair(world):
    """Odometry, touches and finger poses of two slides over the world's object."""
    rng = np.random.default_rng(21)
    a, b = (world.make_slide(world.mesh, 40, rng) for _ in range(2))
    odometry = [*se3.odometry(measure_poses(a, rng))]
    touches = [Measurement(True, code) for code in world.encode(a)]
    return a, odometry, touches, [touch(p, code) for p, code in zip(se3.inverse(a) @ b, world.encode(b), strict=True)]


@pytest.fixture(scope="module")
def filter_(world):
    return ParticleFilter(world.mesh, world.codebook, CONFIG, 0)


def run(filter_, pair, others, touches=None, frames=40):
    """The last estimate, and all bits of what the filter believed; `others`: frame -> fingers."""
    filter_.reset(3)
    filter_.initialise_uniform()
    bits = b""
    for k in range(frames):
        estimate = filter_.step(pair[1][k], (touches or pair[2])[k], others(k))
        bits += filter_.poses.tobytes() + filter_.weights.tobytes()
    return estimate, bits


def test_order_and_absence_of_fingers_change_nothing(filter_, pair):
    third = touch(se3.translation([0, 0, 0.05]))
    one_way = run(filter_, pair, lambda k: {"a": pair[3][k], "b": third}, frames=10)[1]
    assert one_way == run(filter_, pair, lambda k: {"a": pair[3][k], "b": third}, frames=10)[1]
    assert one_way == run(filter_, pair, lambda k: {"b": third, "a": pair[3][k]}, frames=10)[1]
    alone = run(filter_, pair, lambda k: None, frames=10)[1]
    assert alone == run(filter_, pair, lambda k: {}, frames=10)[1]
    assert alone != one_way


def test_a_free_finger_far_from_the_object_changes_nothing(filter_, pair):
    aside = touch(se3.translation([0, 0, 0.4]))
    belief = [run(filter_, pair, lambda k, o=o: o, frames=10)[0] for o in ({}, {"free": aside})]
    np.testing.assert_allclose(belief[0].pose, belief[1].pose, atol=1e-9)


def test_refused_fingers_change_nothing_but_the_count(filter_, pair):
    bad = {"nan": touch(np.eye(4), np.full(64, np.nan)), "warped": touch(2 * np.eye(4), np.ones(64))}
    alone, refused = run(filter_, pair, lambda k: {}, frames=8), run(filter_, pair, lambda k: bad, frames=8)
    assert refused[1] == alone[1]
    assert (refused[0].status.skipped["bad_code"], refused[0].status.skipped["bad_finger_pose"]) == (8, 8)
    assert "finger" in refused[0].status.reason


POSES = {
    "here": np.eye(4),
    "opposite": se3.exp(np.array([0, 0, -0.05, np.pi, 0, 0])),
    "far": se3.translation([9.0, 0, 0]),
    "absurd": se3.translation([1e30, 0, 0]),
    "warped": 2 * np.eye(4),
    "nan": np.full((4, 4), np.nan),
}


@settings(max_examples=25)
@given(st.lists(st.tuples(st.sampled_from(sorted(POSES)), st.integers(0, 5), st.booleans()), min_size=1, max_size=12))
def test_whatever_fingers_measure_the_belief_stays_finite(filter_, pair, frames):
    codes = [pair[3][0].code, np.zeros(64), np.full(64, np.inf), np.ones(3), None, -np.ones(64)]
    filter_.initialise_uniform()
    for k, (pose, code, reference) in enumerate(frames):
        others = {
            "a": Measurement(code != 4, codes[code], penetration=np.ones(3), T_gel_finger=POSES[pose]),
            "b": pair[3][k],
        }
        estimate = filter_.step(pair[1][k], pair[2][k] if reference else Measurement(False), others)
        assert np.isfinite(filter_.poses).all()
        assert np.isfinite(estimate.covariance).all()
        assert filter_.weights.sum() == pytest.approx(1)
        assert math.isfinite(estimate.status.likelihood_trend)
        assert estimate.status.state in state.STATES


def test_codes_of_another_network_are_named(filter_, world):
    filter_.initialise_uniform()
    with pytest.raises(InputError, match=r"other-net.*fourier-test"):
        filter_.step(None, Measurement(False), {"a": touch(np.eye(4), np.ones(64), network_id="other-net")})


def test_two_fingers_tell_more_at_the_first_touch(filter_, pair):
    truth, *_ = pair
    right = []
    for others in (lambda k: {}, lambda k: {"other": pair[3][k]}):
        run(filter_, pair, others, frames=1)
        near = np.linalg.norm(filter_.poses[:, :3, 3] - truth[0][:3, 3], axis=1) < 8e-3
        right.append(filter_.weights[near].sum())
    assert right[1] > right[0] + 0.1


def test_another_finger_counts_while_the_reference_is_in_the_air(filter_, pair):
    air = [Measurement(False)] * 40
    start = pair[0][0] @ se3.exp(np.array([4e-3, -4e-3, 0, 0, 0, 0.1]))
    errors = np.empty((2, 4))
    for case, others in enumerate((lambda k: {}, lambda k: {"other": pair[3][k]})):
        for seed in range(4):
            filter_.reset(seed)
            filter_.initialise_gaussian(start, 6e-3, 0.15)
            for k in range(40):
                estimate = filter_.step(pair[1][k], air[k], others(k))
            errors[case, seed] = np.linalg.norm(estimate.pose[:3, 3] - pair[0][-1][:3, 3])
            assert not case or estimate.status.state in (state.AMBIGUOUS, state.CONVERGED)
    assert errors[1].max() < 5e-3
    assert errors[1].mean() < 0.8 * errors[0].mean()


def test_the_reference_in_the_air_is_not_inside_the_object(filter_, pair):
    """An arm that errs moves all particles into the object; those that are least so are believed more."""
    into = se3.translation([0, 0, -3e-3])
    depths = []
    for reference in (Measurement(False), Measurement(True, np.full(64, np.nan))):
        filter_.reset(0)
        filter_.initialise_gaussian(pair[0][0], 4e-3, 0.02)
        filter_.step(into, reference, {"other": pair[3][0]})
        gels = Particles.from_poses(filter_.poses, np.zeros(len(filter_.poses), int))
        depths.append(-(filter_.weights @ filter_.object.surface.distance(gels)))
    assert depths[0] < depths[1] - 2e-4


def test_a_finger_needs_a_name(filter_):
    with pytest.raises(InputError, match="needs a name"):
        filter_.step(None, Measurement(False), {"": touch(np.eye(4))})


@pytest.mark.slow
@pytest.mark.parametrize("two", [False, True])
def test_two_fingers_tell_what_one_cannot(gripper, two):
    filter_, truth = gripper.make_filter(CONFIG), gripper.above
    filter_.reset(1)
    filter_.initialise_uniform()
    for k, motion in enumerate(gripper.odometry):
        above, below = (
            Measurement(True, codes[k], penetration=reduced_penetration(maps[k]))
            for codes, maps in zip(gripper.codes, gripper.penetrations, strict=True)
        )
        others = {"below": replace(below, T_gel_finger=gripper.between[k])} if two else {}
        estimate = filter_.step(motion, above, others)
    distances = [
        min(np.linalg.norm(mode.pose[:3, 3] - pose[:3, 3]) for mode in estimate.modes)
        for pose in (truth[-1], gripper.half_turn @ truth[-1])
    ]
    if two:
        assert estimate.status.state == state.CONVERGED, estimate.status.reason
        assert np.linalg.norm(estimate.pose[:3, 3] - truth[-1][:3, 3]) < 1e-3
        assert estimate.modes[0].weight > 0.95
    else:
        assert estimate.status.state == state.AMBIGUOUS, estimate.status.reason
        assert max(distances) < 3e-3
        assert estimate.modes[0].weight < 0.9


def test_a_grasp_that_holds_still_is_compared(gripper):
    filter_ = gripper.make_filter(CONFIG)
    filter_.reset(2)
    filter_.initialise_gaussian(gripper.above[0], 0.01, 0.1)
    above, below = (
        Measurement(True, codes[0], penetration=reduced_penetration(maps[0]))
        for codes, maps in zip(gripper.codes, gripper.penetrations, strict=True)
    )
    others = {"below": replace(below, T_gel_finger=gripper.between[0])}
    states = [filter_.step(np.eye(4) if k else None, above, others).status.state for k in range(30)]
    assert states[0] == state.SEARCHING
    assert states[-1] in (state.CONVERGED, state.AMBIGUOUS), "its hypotheses were compared"


@pytest.mark.slow
def test_a_finger_explores_while_the_first_one_rests(gripper):
    """As a thumb that holds the object; the first finger's one touch fits two poses."""
    filter_, truth = gripper.make_filter(CONFIG), gripper.above[0]
    resting = Measurement(True, gripper.codes[0][0], penetration=reduced_penetration(gripper.penetrations[0][0]))
    below = gripper.above @ gripper.between
    errors = []
    for seed in range(3):
        filter_.reset(seed)
        filter_.initialise_uniform()
        for k, gel in enumerate(below):
            exploring = Measurement(
                True, gripper.codes[1][k], penetration=reduced_penetration(gripper.penetrations[1][k])
            )
            others = {"below": replace(exploring, T_gel_finger=se3.inverse(truth) @ gel)}
            estimate = filter_.step(np.eye(4) if k else None, resting, others)
        assert estimate.status.state == state.CONVERGED, estimate.status.reason
        errors.append(np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]))
    assert np.median(errors) < 1e-3
    assert max(errors) < 5e-3


def test_a_penetration_map_that_is_none_costs_only_itself(gripper):
    filter_ = gripper.make_filter(CONFIG)
    filter_.reset(0)
    filter_.initialise_uniform()
    broken = Measurement(True, gripper.codes[1][0], penetration=np.full((80, 60), np.nan, np.float32))
    estimate = filter_.step(None, Measurement(False), {"below": replace(broken, T_gel_finger=gripper.between[0])})
    assert estimate.status.skipped["bad_relief"] == 1
    assert "finger below: penetration" in estimate.status.reason
    assert estimate.status.state == state.SEARCHING, "nothing was compared yet"
