from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from midastouch_common import se3
from midastouch_common.errors import InputError

tangent = arrays(float, (4, 6), elements=st.floats(-3, 3))
seeds = st.integers(0, 2**31)


@given(tangent)
def test_exp_is_a_rigid_transform(xi):
    transform = se3.exp(xi)
    rotation = transform[:, :3, :3]
    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), np.tile(np.eye(3), (4, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation), 1)


@given(tangent)
def test_exp_undoes_log(xi):
    transform = se3.exp(xi)
    np.testing.assert_allclose(se3.exp(se3.log(transform)), transform, atol=1e-9)


@given(tangent)
def test_log_undoes_exp_below_a_half_turn(xi):
    xi = xi * [1, 1, 1, 0.55, 0.55, 0.55]
    np.testing.assert_allclose(se3.log(se3.exp(xi)), xi, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, np.pi - 1e-9, np.pi])
def test_log_at_the_ends_of_the_angle(angle):
    transform = se3.exp(np.array([0.1, -0.2, 0.3, 0, 0, angle]))
    np.testing.assert_allclose(se3.exp(se3.log(transform)), transform, atol=1e-9)
    assert se3.rotation_angle(transform[:3, :3]) == pytest.approx(angle, abs=1e-8)


@given(tangent, tangent)
def test_inverse(a, b):
    ta, tb = se3.exp(a), se3.exp(b)
    np.testing.assert_allclose(se3.inverse(ta @ tb), se3.inverse(tb) @ se3.inverse(ta), atol=1e-9)


@given(tangent)
def test_xyzquat_round_trip(xi):
    transform = se3.exp(xi)
    vector = se3.to_xyzquat(transform)
    vector[:, 3:] *= 2.5  # quaternions off the unit sphere are accepted
    np.testing.assert_allclose(se3.from_xyzquat(vector), transform, atol=1e-12)


@pytest.mark.parametrize(
    ("row", "problem"),
    [([0, 0, 0, 0, 0, 0, 0], "zero quaternion"), ([np.nan, 0, 0, 0, 0, 0, 1], "non-finite"), ([0, 0, 0, 1], "7")],
)
def test_unusable_poses_are_refused(row, problem):
    with pytest.raises(InputError, match=problem):
        se3.from_xyzquat(np.array(row, float))


def test_odometry_leads_from_pose_to_pose():
    poses = se3.exp(np.random.default_rng(0).uniform(-1, 1, (4, 6)))
    first, *steps = se3.odometry(poses)
    assert first is None
    reached = poses[0]
    for step, pose in zip(steps, poses[1:], strict=True):
        reached = reached @ step
        np.testing.assert_allclose(reached, pose, atol=1e-12)
    assert not list(se3.odometry([]))


@given(seeds)
@settings(max_examples=20)
def test_frame_from_normal_has_no_singular_direction(seed):
    rng = np.random.default_rng(seed)
    normals = rng.standard_normal((50, 3)) * [1e-3, 1e-3, 1] * rng.choice([-1, 1], (50, 1))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    frame = se3.frame_from_normal(normals, rng.uniform(0, 7, 50))
    np.testing.assert_allclose(frame[:, :, 2], normals, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frame), 1)


def test_no_transforms_are_no_error(monkeypatch):
    """Of SciPy 1.11.4, which Ubuntu 24.04 has, `Rotation` says "Invalid shape in axis 0: 0." """

    def refused(stack):
        assert len(stack), "Invalid shape in axis 0: 0."

    monkeypatch.setattr(se3, "Rotation", SimpleNamespace(from_quat=refused, from_matrix=refused))
    none = np.zeros((0, 4, 4))
    assert se3.from_xyzquat(np.zeros((2, 0, 7))).shape == (2, 0, 4, 4)
    assert se3.to_xyzquat(none).shape == (0, 7)
    assert se3.log(none).shape == se3.log(se3.exp(np.zeros((0, 6)))).shape == (0, 6)
    assert se3.random_rotations(0, np.random.default_rng(0)).shape == (0, 3, 3)
