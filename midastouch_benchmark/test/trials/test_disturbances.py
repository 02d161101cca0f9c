import dataclasses

import numpy as np
import pytest

from midastouch_benchmark.trials import disturbances
from midastouch_benchmark.trials.disturbances import UndisturbedSlide
from midastouch_benchmark.trials.trial import Event, TrialFrame
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.touch import Measurement
from midastouch_perception.codebook import Codebook

LEAP = se3.make(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.05, 0.0]))


def touches(n: int, code: np.ndarray) -> list[TrialFrame]:
    """n frames along 0.3 m of a circle, turning with it."""
    angle = np.linspace(0, 2, n)
    poses = se3.exp(np.array([0, 0, 0, 0, 0, 1.0]) * angle[:, None]) @ se3.translation([0.15, 0, 0])
    measurement = Measurement(True, code.astype(np.float32))
    return [TrialFrame(i, measurement, {"tdn": 2.0, "tcn": 1.0}, p, p) for i, p in enumerate(poses)]


@pytest.fixture
def frames() -> list[TrialFrame]:
    return touches(99, np.eye(4)[0])


@pytest.fixture
def leaping(frames) -> list[TrialFrame]:
    """The same, 50 mm away and upside down from frame 33 on."""
    moved = [dataclasses.replace(f, measured=LEAP @ f.measured, truth=LEAP @ f.truth) for f in frames[33:]]
    return [*frames[:33], *moved]


def disturb(name: str, frames: list[TrialFrame], **more) -> disturbances.Disturbed:
    return getattr(disturbances, name)(UndisturbedSlide(frames, np.random.default_rng(0), **more))


def odometry(frames: list[TrialFrame]) -> np.ndarray:
    measured = np.array([frame.measured for frame in frames])
    return se3.inverse(measured[:-1]) @ measured[1:]


def motion(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """mm and deg between two poses."""
    relative = se3.inverse(a) @ b
    return 1e3 * np.linalg.norm(relative[:3, 3]), np.degrees(se3.rotation_angle(relative[:3, :3]))


def test_nothing_happens_on_a_plain_slide(frames):
    assert disturb("plain", frames) == disturbances.Disturbed(frames)


def test_a_tool_bias_is_one_error_of_2_mm_and_2_deg(frames):
    disturbed = disturb("tool_bias", frames).frames
    bias = se3.inverse(frames[0].measured) @ disturbed[0].measured
    assert motion(np.eye(4), bias) == pytest.approx((2, 2), rel=1e-3)
    assert se3.inverse(frames[50].measured) @ disturbed[50].measured == pytest.approx(bias, abs=1e-12)


def test_late_poses_are_those_of_50_ms_before(frames):
    assert disturb("late", frames).frames[10].measured == pytest.approx(frames[9].measured, abs=1e-9)


def test_a_rest_repeats_a_frame_for_20_s_but_for_noise(frames):
    disturbed = disturb("rest", frames)
    assert [frame.index for frame in disturbed.frames] == [*range(33), *[33] * 401, *range(34, 99)]
    assert disturbed.frames[disturbed.event.end].index == 34
    still, at_rest = frames[33], disturbed.frames[disturbed.event.start : disturbed.event.end]
    moved = [se3.log(se3.inverse(still.measured) @ frame.measured) for frame in at_rest]
    assert 0 < np.abs(np.array(moved)[:, :3]).max() < 2e-4
    changed = [np.linalg.norm(frame.measurement.code - still.measurement.code) for frame in at_rest]
    assert min(changed) > 0
    assert np.mean(changed) == pytest.approx(0.01, rel=0.5)
    assert all((frame.truth == still.truth).all() for frame in at_rest)


def test_a_slow_camera_shows_every_image_twice_on_the_same_path(frames):
    disturbed = disturb("slow_camera", frames).frames
    assert [frame.index for frame in disturbed[:5]] == [0, 0, 1, 1, 2]
    assert len(disturbed) == 197
    assert disturbed[1].measurement is frames[0].measurement
    assert disturbed[1].ms == {}
    steps = odometry(disturbed)
    assert steps[0] @ steps[1] == pytest.approx(odometry(frames)[0], abs=1e-12)
    assert steps[0] == pytest.approx(steps[1], abs=1e-9)
    assert se3.inverse(disturbed[1].truth) @ frames[1].truth == pytest.approx(steps[1], abs=1e-9)


def test_a_jump_is_reported(leaping):
    disturbed = disturb("jump", leaping)
    assert disturbed.frames == leaping
    assert disturbed.event == Event(33, 33)


@pytest.mark.parametrize(("name", "reported"), [("lift", True), ("kidnap", False)])
def test_a_lift_is_reported_and_a_kidnapping_is_not(leaping, name, reported):
    disturbed = disturb(name, leaping)
    frames, down = disturbed.frames, disturbed.event.end
    assert disturbed.event.start == down - 10 == 33
    assert [k for k, frame in enumerate(frames) if not frame.measurement.in_contact] == list(range(down - 10, down))
    away = frames[down].truth[:3, 3] - frames[down - 11].truth[:3, 3]
    assert np.linalg.norm(away) > 0.04
    described = np.linalg.norm(odometry(frames)[down - 1, :3, 3])
    assert described == pytest.approx(np.linalg.norm(away) if reported else 0.0, abs=1e-9)
    # from then on both move as the sensor does
    assert odometry(frames)[down + 3] == pytest.approx(odometry(leaping)[36], abs=1e-9)
    # up to 20 mm off the surface and down again
    heights = [(se3.inverse(frames[down - 11].truth) @ frame.truth)[2, 3] for frame in frames[down - 10 : down]]
    assert heights == pytest.approx(1e-3 * np.array([4, 8, 12, 16, 20, 16, 12, 8, 4, 0]), abs=1e-9)


def test_a_pushed_object_moves_without_the_odometrys_knowing(frames):
    disturbed = disturb("push", frames)
    assert disturbed.event == Event(33, 38)
    assert all((a.truth == b.truth).all() for a, b in zip(disturbed.frames, frames, strict=True))
    assert odometry(disturbed.frames)[:32] == pytest.approx(odometry(frames)[:32], abs=1e-12)
    assert odometry(disturbed.frames)[38:] == pytest.approx(odometry(frames)[38:], abs=1e-12)
    contact = np.array([*frames[33].truth[:3, 3], 1])
    object_moved = disturbed.frames[38].measured @ se3.inverse(frames[38].measured)
    assert 1e3 * np.linalg.norm(object_moved @ contact - contact) == pytest.approx(5, rel=0.01)
    assert np.degrees(se3.rotation_angle(object_moved[:3, :3])) == pytest.approx(5)


def test_the_least_explained_foreign_touches_replace_twelve(frames):
    foreign = touches(40, np.array([1.0, 0.1, 0, 0]))
    strange = Measurement(True, np.array([0, 0, 1, 0.1], np.float32))
    foreign[20:34] = [dataclasses.replace(f, measurement=strange) for f in foreign[20:34]]
    foreign[5] = dataclasses.replace(foreign[5], measurement=Measurement(False))
    book = Codebook(np.tile(np.eye(4), (2, 1, 1)), np.eye(4, dtype=np.float32)[:2], {})
    disturbed = disturb("unexplained", frames, foreign=foreign, codebook=book)
    measurement = [frame.measurement is strange for frame in disturbed.frames]
    assert [k for k, other in enumerate(measurement) if other] == list(range(33, 45))
    assert disturbed.event == Event(33, 45)
    assert all((a.measured == b.measured).all() for a, b in zip(disturbed.frames, frames, strict=True))
    with pytest.raises(InputError, match=r"12 touches.*--length"):
        disturb("unexplained", frames, foreign=foreign[:7], codebook=book)


def test_on_the_wrong_object_no_pose_is_true(frames):
    foreign = touches(20, np.eye(4)[1])
    disturbed = disturb("wrong_mesh", frames, foreign=foreign)
    assert all(np.isnan(frame.truth).all() for frame in disturbed.frames)
    assert [frame.measurement for frame in disturbed.frames] == [frame.measurement for frame in foreign]


@pytest.mark.parametrize("name", ["rest", "lift", "push"])
def test_a_slide_too_short_to_disturb_is_refused(frames, name):
    with pytest.raises(InputError, match=r"2 frames.*give a longer one"):
        disturb(name, frames[:2])
