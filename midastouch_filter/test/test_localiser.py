from __future__ import annotations

import math

import numpy as np
import pytest
from filter_fakes import DIAGONAL, FakeFilter, StubGrowth
from tf_messages import translation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.touch import Measurement
from midastouch_filter.loaded_object import LoadedObject
from midastouch_filter.localiser import Localiser, Start, spread_at_lever, spread_of

TOUCH = Measurement(True, np.array([0.6, 0.8], np.float32), 1e-5, "fake")
START = Start(translation(0.1), 0.01, 0.2)


def localiser(first_start=None, wait=False) -> tuple[Localiser, FakeFilter]:
    out, running = Localiser(first_start, wait), FakeFilter()
    out.set_object(LoadedObject(running, DIAGONAL, "thing"))
    return out, running


def test_odometry_is_the_motion_since_the_last_frame():
    subject, running = localiser()
    rng = np.random.default_rng(0)
    a, b = se3.make(se3.random_rotations(2, rng), rng.normal(size=(2, 3)))
    subject.process(a, TOUCH)
    subject.process(b, TOUCH)
    assert running.odometry[0] is None
    np.testing.assert_allclose(a @ running.odometry[1], b, atol=1e-12)


def test_the_object_goes_with_a_gripper_until_nothing_touches():
    subject, running = localiser()
    rng = np.random.default_rng(0)
    bases, grippers = (se3.make(se3.random_rotations(6, rng), rng.normal(size=(6, 3))) for _ in range(2))
    air = Measurement(False)
    seen = [(air, air), (TOUCH, air), (TOUCH, TOUCH), (air, TOUCH), (air, air), (TOUCH, air)]
    held = []
    for base, gripper, (one, other) in zip(bases, grippers, seen, strict=True):
        subject.process(base, one, {"right": other}, None, gripper)
        held.append(subject.held)
    assert held == [False, False, True, True, False, False]
    for k, moved in enumerate(running.odometry[1:]):
        frame = grippers if held[k] else bases
        np.testing.assert_allclose(frame[k] @ moved, frame[k + 1], atol=1e-12)
    subject.process(bases[0], TOUCH, {"right": TOUCH}, None, grippers[0])
    subject.restart()
    assert not subject.held


def test_only_a_running_filter_has_a_deferred_update():
    subject, running = localiser(wait=True)
    subject.deferred_update()
    assert running.deferred_updates == []
    subject.start_at(START)
    subject.process(np.eye(4), TOUCH)
    subject.deferred_update()
    assert running.deferred_updates == [1]


def test_motion_during_a_refused_measurement_is_not_lost():
    subject, running = localiser()
    subject.process(translation(0.0), TOUCH)
    with pytest.raises(InputError, match="network"):
        subject.process(translation(0.01), Measurement(True, TOUCH.code, 1e-5, "other"))
    subject.process(translation(0.03), TOUCH)
    np.testing.assert_allclose(running.odometry[1], translation(0.03), atol=1e-12)


def test_wait_starts_with_a_given_pose_and_again_from_it():
    subject, running = localiser(wait=True)
    assert subject.process(np.eye(4), TOUCH) is None
    assert "initialpose" in subject.waiting_for
    subject.start_at(START)
    assert subject.process(np.eye(4), TOUCH) is not None
    subject.restart()
    assert [start[0] is START.pose for start in running.starts] == [True, True]
    assert subject.process(translation(5), TOUCH) is not None
    assert running.odometry[-1] is None, "a restart forgets where the sensor was"


def test_start_anywhere_ends_waiting():
    subject, running = localiser(wait=True)
    subject.start_anywhere()
    assert running.starts == ["uniform"]
    assert subject.waiting_for == ""


def test_another_object_does_not_inherit_a_pose():
    subject, _ = localiser(first_start=START)
    subject.expect_object_at(translation(0.5), 0.01, 0.1)
    second = FakeFilter()
    subject.set_object(LoadedObject(second, DIAGONAL, "other"))
    assert subject.estimate is None
    subject.process(np.eye(4), TOUCH)
    assert second.starts == ["uniform"]


class Growing(FakeFilter):
    """A filter whose codebook can be changed."""

    def __init__(self):
        super().__init__()
        self.object.density = "codebook of 5,000 poses"

    def take(self, prepared):
        self.object.density = prepared


def test_a_denser_codebook_is_taken_between_two_frames_and_said():
    subject, growth = Localiser(None, wait=False), StubGrowth()
    subject.set_object(LoadedObject(Growing(), DIAGONAL, "thing", growth=growth))
    assert growth.calls == ["start"]
    subject.process(np.eye(4), TOUCH)
    assert subject.coarse == "codebook of 5,000 poses; growing"
    growth.ready = dense = "codebook of 50,000 poses"
    subject.process(np.eye(4), TOUCH)
    assert (subject.object.density, subject.coarse) == (dense, f"{dense}; growing")
    growth.done = True
    assert subject.coarse == ""
    growth.failure = "MemoryError: no room"
    assert subject.coarse == f"{dense}; no denser: MemoryError: no room"


def test_an_object_that_is_left_grows_no_more():
    subject, growth = Localiser(None, wait=False), StubGrowth()
    subject.close()
    subject.set_object(LoadedObject(Growing(), DIAGONAL, "thing", growth=growth))
    subject.set_object(LoadedObject(FakeFilter(), DIAGONAL, "other"))
    assert growth.calls == ["start", "close"]
    assert subject.coarse == ""


def test_object_prior_starts_where_the_sensor_is_on_it():
    subject, running = localiser(wait=True)
    T_base_obj = se3.make(se3.random_rotations(1, np.random.default_rng(1))[0], np.array([0.5, 0.1, 0.2]))
    T_obj_gel = translation(0.03, 0.04)
    subject.expect_object_at(T_base_obj, 0.003, 0.08)
    subject.process(T_base_obj @ T_obj_gel, TOUCH)
    pose, sigma_t, sigma_r = running.starts[-1]
    np.testing.assert_allclose(pose, T_obj_gel, atol=1e-12)
    assert sigma_t == pytest.approx(0.005), "0.08 rad at 5 cm, and 3 mm"
    assert sigma_r == 0.08
    subject.process(T_base_obj @ T_obj_gel, TOUCH)
    assert len(running.starts) == 1, "a prior counts once"


def test_an_unusable_prior_is_refused_and_forgotten():
    """Kept, it would end the node at the next restart."""
    subject, running = localiser()
    subject.expect_object_at(translation(1e300), 0.01, 0.1)
    with pytest.raises(InputError, match="prior pose"):
        subject.process(np.eye(4), TOUCH)
    subject.restart()
    assert running.starts == ["uniform", "uniform"]
    assert subject.process(np.eye(4), TOUCH) is not None


def test_what_was_said_last_counts():
    subject, running = localiser()
    subject.expect_object_at(translation(0.5), 0.01, 0.1)
    subject.start_at(START)
    subject.process(np.eye(4), TOUCH)
    assert running.starts[-1][0] is START.pose
    subject.expect_object_at(translation(0.5), 0.01, 0.1)
    subject.start_anywhere()
    subject.process(np.eye(4), TOUCH)
    assert running.starts[-1] == "uniform"


def test_a_loop_starts_where_the_sensor_is_on_the_seen_object():
    """A looped bag: the sensor is elsewhere at its beginning than it was when the camera saw the object."""
    subject, running = localiser(wait=True)
    T_base_obj = translation(0.5, 0.1)
    subject.process(T_base_obj @ translation(0.01), TOUCH)
    subject.expect_object_at(T_base_obj, 0.01, 0.1)
    subject.process(T_base_obj @ translation(0.03), TOUCH)
    subject.restart()
    assert subject.process(T_base_obj @ translation(0.01), TOUCH) is not None
    np.testing.assert_allclose([start[0] for start in running.starts], [translation(0.03), translation(0.01)])


RVIZ = (0.25, 0.25, 0, 0, 0, (math.pi / 12) ** 2)  # 2D Pose Estimate: zeros that mean "unknown"


@pytest.mark.parametrize(
    ("variances", "diagonal", "sigma_t", "sigma_r"),
    [
        ((1e-6, 4e-4, 1e-6, 0.01, 0.04, 0.01), DIAGONAL, 0.02, 0.2),
        (RVIZ, DIAGONAL, DIAGONAL / 3, math.radians(60)),
        ((0.25, 0.25, 0.25, 10, 10, 10), DIAGONAL, DIAGONAL / 3, math.radians(60)),
        ((1e-18,) * 6, DIAGONAL, 5e-4, math.radians(1)),
        ((1e-8,) * 6, 6e-4, 2e-4, math.radians(1)),
    ],
    ids=["the largest counts", "RViz", "wider than the object", "overconfident", "a tiny object"],
)
def test_a_covariance_is_bounded_by_the_object(variances, diagonal, sigma_t, sigma_r):
    assert spread_of(np.diag(variances), diagonal) == pytest.approx((sigma_t, sigma_r))


def test_rotation_widens_the_position_at_the_end_of_a_lever():
    assert spread_at_lever(0.003, 0.04, 0.1) == pytest.approx(0.005)
    assert spread_at_lever(0.003, 0.04, 0.0) == pytest.approx(0.003)
