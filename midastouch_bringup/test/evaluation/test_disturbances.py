import numpy as np
import pytest

from midastouch_bringup.evaluation.disturbances import (
    DISTURBANCES,
    kidnap,
    lift,
    rest,
    slow_camera,
    time_offset,
    tool_bias,
)
from midastouch_bringup.evaluation.trial import TrialFrame
from midastouch_filter.filter import Measurement
from midastouch_perception import se3
from midastouch_perception.errors import InputError


@pytest.fixture
def frames() -> list[TrialFrame]:
    """100 frames along 0.3 m of a circle, turning with it."""
    angle = np.linspace(0, 2, 100)
    poses = se3.exp(np.array([0, 0, 0, 0, 0, 1.0]) * angle[:, None]) @ se3.make(np.eye(3), [0.15, 0, 0])
    code = np.ones(4, np.float32)
    return [TrialFrame(i, Measurement(True, code), {"tdn": 2.0, "tcn": 1.0}, p, p) for i, p in enumerate(poses)]


def odometry(frames: list[TrialFrame]) -> np.ndarray:
    measured = np.array([frame.measured for frame in frames])
    return se3.inverse(measured[:-1]) @ measured[1:]


@pytest.mark.parametrize("name", DISTURBANCES)
def test_the_first_pose_and_the_truth_stay(frames, name):
    disturbed = DISTURBANCES[name](frames, np.random.default_rng(0))
    assert disturbed[0].index == 0
    by_index = {frame.index: frame.truth for frame in frames}
    if name == "slow_camera":
        disturbed = disturbed[::2]  # what lies between is new
    assert all((frame.truth == by_index[frame.index]).all() for frame in disturbed if frame.felt.in_contact)


def test_a_tool_bias_is_one_error_of_2_mm_and_2_deg(frames):
    disturbed = tool_bias(frames, np.random.default_rng(0))
    bias = se3.inverse(frames[0].measured) @ disturbed[0].measured
    assert np.linalg.norm(bias[:3, 3]) == pytest.approx(2e-3, rel=1e-3)
    assert np.degrees(se3.rotation_angle(bias[:3, :3])) == pytest.approx(2)
    assert se3.inverse(frames[50].measured) @ disturbed[50].measured == pytest.approx(bias, abs=1e-12)


def test_a_time_offset_hands_out_poses_of_50_ms_before(frames):
    disturbed = time_offset(frames, np.random.default_rng(0))
    assert disturbed[10].measured == pytest.approx(frames[9].measured, abs=1e-9)


def test_a_rest_repeats_a_frame_but_for_noise(frames):
    disturbed = rest(frames, np.random.default_rng(0))
    assert [frame.index for frame in disturbed[38:62]] == [38, *[39] * 21, 40, 41]
    assert len(disturbed) == len(frames) + 2 * 20
    still, at_rest = disturbed[39], disturbed[40:60]
    moved = [se3.log(se3.inverse(still.measured) @ frame.measured) for frame in at_rest]
    assert 0 < np.abs(np.array(moved)[:, :3]).max() < 1e-4
    changed = [np.linalg.norm(frame.felt.code - still.felt.code) for frame in at_rest]
    assert min(changed) > 0
    assert np.mean(changed) == pytest.approx(0.01, rel=0.5)
    assert all((frame.truth == still.truth).all() for frame in at_rest)
    assert frames[38:40] == disturbed[38:40]


def test_a_slow_camera_shows_every_image_twice_on_the_same_path(frames):
    disturbed = slow_camera(frames, np.random.default_rng(0))
    assert [frame.index for frame in disturbed[:5]] == [0, 0, 1, 1, 2]
    assert len(disturbed) == 199
    assert disturbed[1].felt is frames[0].felt
    assert disturbed[1].ms == {}
    steps = odometry(disturbed)
    assert steps[0] @ steps[1] == pytest.approx(odometry(frames)[0], abs=1e-12)
    assert steps[0] == pytest.approx(steps[1], abs=1e-9)
    assert se3.inverse(disturbed[1].truth) @ frames[1].truth == pytest.approx(steps[1], abs=1e-9)


def test_a_lift_is_told_and_a_kidnapping_is_not(frames):
    for disturb, told in ((lift, True), (kidnap, False)):
        disturbed = disturb(frames, np.random.default_rng(0))
        in_contact = np.array([frame.felt.in_contact for frame in disturbed])
        assert (~in_contact).sum() == 10
        down = np.flatnonzero(~in_contact)[-1] + 1
        away = disturbed[down].truth[:3, 3] - disturbed[down - 11].truth[:3, 3]
        assert np.linalg.norm(away) == pytest.approx(0.05, abs=0.003)
        jumps = np.linalg.norm(odometry(disturbed)[:, :3, 3], axis=1)
        assert jumps[down - 1] == pytest.approx(np.linalg.norm(away) if told else 0.0, abs=1e-9)
        # from then on both move as the sensor does
        assert odometry(disturbed)[down + 3] == pytest.approx(odometry(frames)[3], abs=1e-9)
        assert disturbed[down - 1].ms == {}
        # up to 20 mm off the surface and down again
        heights = [
            (se3.inverse(disturbed[down - 11].truth) @ frame.truth)[2, 3] for frame in disturbed[down - 10 : down]
        ]
        assert heights == pytest.approx(1e-3 * np.array([4, 8, 12, 16, 20, 16, 12, 8, 4, 0]), abs=1e-9)


def test_a_slide_too_short_to_lift_is_refused(frames):
    with pytest.raises(InputError, match="too short"):
        lift(frames[:1], np.random.default_rng(0))
