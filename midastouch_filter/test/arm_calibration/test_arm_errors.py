"""Simulated motion: an arm with a wrong mount, a late clock, or an object that moves, and alignments of the touches."""

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.arm_calibration.arm_errors import ArmErrors

FRAME = 0.05  # s


def spread(translation, rotation_deg):
    return np.diag(np.repeat([translation, np.radians(rotation_deg)], 3) ** 2)


JITTER, MOUNT, JUMP = spread(5e-4, 1.0), spread(2e-3, 2.0), spread(3e-3, 3.0)


def make(mount=MOUNT, clock=0.05, jump=JUMP):
    return ArmErrors(mount, clock, JITTER, jump, spread(4e-3, 12.0))


def path(frames, rng, turns=True):
    """Poses (frames, 4, 4) of a slide: 1.5 mm a frame, another heading and axis of rotation every 25 frames."""
    poses = [np.eye(4)]
    for i in range(frames - 1):
        if i % 25 == 0:
            heading, turn = rng.uniform(0, 2 * np.pi), rng.standard_normal(3) * np.radians(1.5) * turns
        poses.append(poses[-1] @ se3.exp(np.r_[1.5e-3 * np.cos(heading), 1.5e-3 * np.sin(heading), 0, turn]))
    return np.array(poses)


def slide(errors, truth, measured, rng, elapsed=FRAME):
    """Let it see everything; the frames in which the object was said to move, and the last jump."""
    jumps, jump = [], None
    scale = np.repeat([2e-4, np.radians(0.6)], 3)
    for i in range(1, len(truth)):
        errors.corrected(se3.inverse(measured[i - 1]) @ measured[i], elapsed)
        if errors.jump is not None:
            jumps.append(i)
            jump = errors.jump
        # each touch tells three of six directions, others each time
        axes = np.linalg.qr(rng.standard_normal((6, 6)))[0][:, :3]
        information = 0.2 * (axes / scale[:, None]) @ (axes / scale[:, None]).T
        errors.observe(truth[i], 0.5 * scale * rng.standard_normal(6), information)
    return jumps, jump


def with_jitter(poses, rng):
    return poses @ se3.exp(rng.multivariate_normal(np.zeros(6), JITTER, len(poses)))


@pytest.mark.parametrize("seed", range(3))
def test_mount_and_clock_are_found(seed):
    rng = np.random.default_rng(seed)
    truth = path(300, rng)
    mount = se3.exp([1.5e-3, -1e-3, 1e-3, 0.02, -0.015, 0.02])
    measured = with_jitter(truth @ mount, rng)
    measured = measured[np.maximum(np.arange(300) - 1, 0)]  # a frame late
    errors = make()
    jumps, _ = slide(errors, truth, measured, rng)
    found = errors.calibration
    wrong = np.r_[se3.log(se3.inverse(mount) @ found.mount), found.clock - FRAME]
    assert jumps == []
    assert found.known.all()
    assert np.linalg.norm(wrong[:3]) < 6e-4
    assert np.linalg.norm(wrong[3:6]) < np.radians(1.2)
    assert abs(wrong[6]) < 0.008
    assert wrong @ np.linalg.solve(found.covariance, wrong) < 30  # 7 are expected


def test_what_is_learnt_is_taken_out_of_the_motion():
    rng = np.random.default_rng(5)
    truth, mount = path(300, rng), se3.exp([2e-3, 0, 0, 0, 0.035, 0])
    measured = truth @ mount
    errors = make()
    slide(errors, truth, measured, rng)
    turn = se3.exp([0, 0, 0, 0.4, -0.3, 0.5])
    told = se3.inverse(mount) @ turn @ mount
    lacks = np.linalg.norm(se3.log(se3.inverse(turn) @ errors.corrected(told, FRAME)))
    assert lacks < 0.2 * np.linalg.norm(se3.log(se3.inverse(turn) @ told))


def test_without_turns_the_position_of_the_mount_stays_unknown():
    rng = np.random.default_rng(6)
    truth = path(300, rng, turns=False)
    errors = make()
    slide(errors, truth, with_jitter(truth, rng), rng)
    assert not errors.calibration.known[:3].any()


def test_without_times_nothing_is_said_of_the_clock():
    rng = np.random.default_rng(7)
    truth = path(150, rng)
    errors = make()
    slide(errors, truth, with_jitter(truth, rng), rng, elapsed=None)
    assert not errors.calibration.known[6]
    assert errors.calibration.clock == 0


def test_what_is_believed_is_not_touched():
    rng = np.random.default_rng(8)
    truth = path(100, rng)
    errors = make(mount=np.zeros((6, 6)), clock=0.0)
    slide(errors, truth, with_jitter(truth @ se3.exp([1e-3, 0, 0, 0, 0, 0]), rng), rng)
    assert np.array_equal(errors.calibration.mount, np.eye(4))
    assert errors.calibration.clock == 0
    assert not errors.calibration.known.any()


@pytest.mark.parametrize("frames", [1, 5])
def test_a_push_is_noticed_within_ten_frames(frames):
    late = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        truth = path(140, rng)
        directions = rng.standard_normal((2, 3))
        directions *= np.array([[5e-3], [np.radians(5)]]) / np.linalg.norm(directions, axis=1, keepdims=True)
        fraction = np.clip((np.arange(140) - 99) / frames, 0, 1)
        about = truth[100]
        pushed = about @ se3.exp(fraction[:, None] * directions.reshape(6)) @ se3.inverse(about) @ truth
        errors = make()
        jumps, jump = slide(errors, truth, with_jitter(pushed, rng), rng)
        assert jumps
        assert jumps[0] >= 100
        late.append(jumps[0] - 100)
        if frames == 1:
            assert np.linalg.norm(jump.moved[:3, 3]) == pytest.approx(5e-3, abs=3e-3)
    assert max(late) <= 10


def test_an_object_at_rest_is_not_said_to_move():
    rng = np.random.default_rng(9)
    truth = path(2000, rng)
    assert slide(make(), truth, with_jitter(truth @ se3.exp([2e-3, 0, 0, 0, 0, 0.03]), rng), rng)[0] == []


def test_pushes_are_not_looked_for_unless_asked():
    rng = np.random.default_rng(10)
    truth = path(120, rng)
    measured = with_jitter(truth, rng)
    measured[60:] = se3.exp([8e-3, 0, 8e-3, 0, 0, 0]) @ measured[60:]
    assert slide(make(jump=None), truth, measured, rng)[0] == []


def test_a_restart_forgets_the_pose_and_keeps_mount_and_clock():
    rng = np.random.default_rng(11)
    truth = path(300, rng)
    mount = se3.exp([2e-3, 0, 0, 0, 0.03, 0])
    errors = make()
    slide(errors, truth, with_jitter(truth @ mount, rng), rng)
    before = errors.calibration
    errors.restart()
    np.testing.assert_array_equal(errors.calibration.mount, before.mount)
    elsewhere = se3.exp([0.3, 0.1, 0, 1.0, 2.0, 0]) @ path(60, rng)
    assert slide(errors, elsewhere, with_jitter(elsewhere @ mount, rng), rng)[0] == []
    assert (errors.calibration.sigma <= before.sigma + 1e-12).all()
