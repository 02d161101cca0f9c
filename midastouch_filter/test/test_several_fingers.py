"""The filter with several fingers: what they tell, and a gripper that tells what one finger cannot."""

from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement, reduced_penetration

CONFIG = FilterConfig(threads=1)
FRAME = 1 / 30  # s
AIR = Measurement(False)


@pytest.fixture(scope="module")
def hand(gripper):
    """Touches of both fingers in each frame: the first one's, and the other one's with its pose."""
    above, below = (
        [Measurement(True, code, penetration=reduced_penetration(map_)) for code, map_ in zip(codes, maps, strict=True)]
        for codes, maps in zip(gripper.codes, gripper.penetrations, strict=True)
    )
    return above, [replace(touch, T_gel_finger=pose) for touch, pose in zip(below, gripper.between, strict=True)]


@pytest.fixture
def filter_(gripper):
    filter_ = gripper.make_filter(CONFIG)
    filter_.reset(1)
    filter_.initialise_uniform()
    return filter_


def run(filter_, gripper, touches, others, frames=75):
    """The last estimate; `others`: frame -> fingers."""
    for k in range(frames):
        estimate = filter_.step(gripper.odometry[k], touches[k], others(k), elapsed=FRAME)
    return estimate


def off(estimate, pose):
    return np.linalg.norm(estimate.pose[:3, 3] - pose[:3, 3])


@pytest.mark.parametrize("two", [False, True])
def test_two_fingers_tell_what_one_cannot(filter_, gripper, hand, two):
    above, below = hand
    estimate = run(filter_, gripper, above, lambda k: {"below": below[k]} if two else {})
    truth = gripper.above[-1]
    if two:
        assert estimate.status.state == state.CONVERGED, estimate.status.reason
        assert off(estimate, truth) < 2e-3
        return
    assert estimate.status.state == state.AMBIGUOUS, estimate.status.reason
    for pose in (truth, gripper.half_turn @ truth):
        assert min(np.linalg.norm(mode.pose[:3, 3] - pose[:3, 3]) for mode in estimate.modes) < 3e-3
    assert np.sqrt(np.trace(estimate.covariance[:3, :3])) > 0.01, "it says how far away the other one is"


def test_what_a_still_grasp_tells_is_worked_out_with_time(filter_, gripper, hand):
    above, below = hand
    listed = []
    for k in range(60):
        estimate = filter_.step(np.eye(4) if k else None, above[40], {"below": below[40]}, elapsed=FRAME)
        listed.append(1 - filter_.belief.untested_mass)
    assert estimate.status.state in (state.CONVERGED, state.AMBIGUOUS)
    assert off(estimate, gripper.above[40]) < 3e-3
    assert listed[0] < 0.5
    assert listed[3] < listed[-1]
    assert listed[-1] > 0.9


def test_a_second_finger_closing_at_rest_is_a_new_touch(filter_, hand):
    above, below = hand
    for k in range(5):
        filter_.step(np.eye(4) if k else None, above[0], {}, elapsed=FRAME)
    estimate = filter_.step(np.eye(4), above[0], {"below": below[0]}, elapsed=FRAME)
    assert estimate.status.skipped["keyframes"] == 2


def test_a_finger_explores_while_the_first_one_rests(filter_, gripper, hand):
    """As a thumb that holds the object; the first finger's one touch fits two poses."""
    (resting, *_), below = hand
    truth = gripper.above[0]
    for k, gel in enumerate(gripper.above @ gripper.between):
        others = {"below": replace(below[k], T_gel_finger=se3.inverse(truth) @ gel)}
        estimate = filter_.step(np.eye(4) if k else None, resting, others, elapsed=FRAME)
    assert off(estimate, truth) < 5e-3
    assert estimate.status.state == state.CONVERGED, estimate.status.reason


def test_another_finger_tells_while_the_first_one_is_in_the_air(filter_, gripper, hand):
    _, below = hand
    run(filter_, gripper, [AIR], lambda k: {"below": below[k]}, frames=1)
    (some,) = filter_.belief.untested
    np.testing.assert_allclose(some.poses @ gripper.between[0], filter_.object.lookup.poses, atol=1e-5)
    filter_.initialise_uniform()
    estimate = run(filter_, gripper, [AIR] * 75, lambda k: {"below": below[k]})
    assert off(estimate, gripper.above[-1]) < 5e-3
    assert estimate.status.state in (state.AMBIGUOUS, state.CONVERGED)


def test_the_finger_whose_code_says_most_tells_where_to_search(mapped_slide):
    """The first one is on a side that no entry touches with, and its code is alike for all of them."""
    filter_ = mapped_slide.make_filter()
    filter_.initialise_uniform()
    codes = filter_.object.measurement.codes
    flat = np.linalg.svd(codes.astype(float), full_matrices=False)[2][-1]
    tilted = mapped_slide.poses[::-1] @ se3.exp([0, 0, 0, 0.5, 0, 0])
    deepest = np.array([touch.penetration.max() for touch in mapped_slide.touches_at(tilted)])
    tilted[:, :3, 3] += (deepest - 1e-3)[:, None] * tilted[:, :3, 2]
    touches = [replace(touch, code=flat) for touch in mapped_slide.touches_at(tilted)]
    between = se3.inverse(tilted) @ mapped_slide.poses
    estimates = []
    for k, motion in enumerate([*se3.odometry(tilted)][:25]):
        others = {"other": replace(mapped_slide.touches[k], T_gel_finger=between[k])}
        estimates.append(filter_.step(motion, touches[k], others, elapsed=FRAME))
    assert off(estimates[0], tilted[0]) < 0.015
    assert estimates[-1].status.state == state.CONVERGED, estimates[-1].status.reason
    assert off(estimates[-1], tilted[24]) < 2e-3


def test_neither_order_nor_a_far_finger_changes_anything(filter_, gripper, hand):
    above, below = hand
    aside = Measurement(False, T_gel_finger=se3.translation([0, 0, 0.4]))
    poses = []
    for names in (("a",), ("a", "free"), ("free", "a")):
        filter_.initialise_uniform()
        fingers = {"a": below, "free": [aside] * 75}
        poses.append(run(filter_, gripper, above, lambda k, n=names, f=fingers: {name: f[name][k] for name in n}, 10))
    for each in poses[1:]:
        np.testing.assert_array_equal(each.pose, poses[0].pose)
        np.testing.assert_array_equal(each.covariance, poses[0].covariance)


def test_refused_fingers_change_nothing_but_the_count(filter_, gripper, hand):
    above, below = hand
    bad = {
        "map": replace(below[0], penetration=np.full((80, 60), np.nan, np.float32)),
        "nan": replace(below[0], code=np.full(64, np.nan)),
        "warped": replace(below[0], T_gel_finger=2 * np.eye(4)),
    }
    alone = run(filter_, gripper, above, lambda k: {}, 8)
    filter_.initialise_uniform()
    refused = run(filter_, gripper, above, lambda k: bad, 8)
    np.testing.assert_array_equal(alone.pose, refused.pose)
    counts = [refused.status.skipped[kind] for kind in ("bad_relief", "bad_code", "bad_finger_pose")]
    assert counts == [8, 8, 8]
    assert "finger" in refused.status.reason
