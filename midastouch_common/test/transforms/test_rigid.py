"""Rigid transforms as seven numbers, against SciPy and matrices; which are refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from midastouch_common import se3
from midastouch_common.transforms.rigid import TransformError, checked_pose, interpolate, invert, multiply, to_matrix

seeds = st.integers(0, 2**32 - 1)


def random_poses(n: int, seed: int) -> list[tuple]:
    rng = np.random.default_rng(seed)
    return [tuple(pose) for pose in np.hstack([rng.uniform(-1, 1, (n, 3)), Rotation.random(n, rng).as_quat()]).tolist()]


@given(seed=seeds, fraction=st.floats(0, 1))
def test_interpolation_is_lerp_and_slerp_for_both_signs(seed, fraction):
    start, end = random_poses(2, seed)
    rotation = Slerp([0, 1], Rotation.from_quat([start[3:], end[3:]]))(fraction).as_matrix()
    place = (1 - fraction) * np.array(start[:3]) + fraction * np.array(end[:3])
    for other in (end, (*end[:3], *(-x for x in end[3:]))):
        got = to_matrix(interpolate(start, other, fraction))
        np.testing.assert_allclose(got, se3.make(rotation, place), atol=1e-9)


@given(seed=seeds, fraction=st.floats(0, 1), angle=st.floats(1e-12, 1e-3))
def test_tiny_rotations_keep_their_accuracy(seed, fraction, angle):
    (start,) = random_poses(1, seed)
    end = multiply(start, (0.0, 0.0, 0.0, np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2)))
    turned = se3.log(se3.inverse(to_matrix(start)) @ to_matrix(interpolate(start, end, fraction)))[3:]
    np.testing.assert_allclose(turned, [fraction * angle, 0, 0], atol=1e-9 * angle + 3e-15)


@given(seed=seeds)
def test_products_and_inverses_are_those_of_the_matrices(seed):
    a, b = random_poses(2, seed)
    np.testing.assert_allclose(to_matrix(multiply(a, b)), to_matrix(a) @ to_matrix(b), atol=1e-12)
    np.testing.assert_allclose(to_matrix(invert(a)), se3.inverse(to_matrix(a)), atol=1e-12)


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        ((0, 0, 0, 0, 0, 0, 0.0), "zero"),
        ((0, 0, 0, 0, 0, 0, 1.1), "not a unit quaternion"),
        ((np.nan, 0, 0, 0, 0, 0, 1), "NaN"),
        ((0, 0, 0, 0, 0, np.inf, 1), "NaN or infinite"),
    ],
)
def test_what_is_not_rigid_is_refused_with_a_reason(pose, reason):
    with pytest.raises(TransformError, match=f"'base' -> 'gel'.*{reason}"):
        checked_pose("base", "gel", pose)


@pytest.mark.parametrize(("parent", "child"), [("gel", "gel"), ("", "gel"), ("base", "")])
def test_frame_names_must_be_two_different_ones(parent, child):
    with pytest.raises(TransformError, match="frame names"):
        checked_pose(parent, child, (0, 0, 0, 0, 0, 0, 1))


def test_almost_unit_quaternions_are_normalised():
    rotation = to_matrix(checked_pose("base", "gel", (0, 0, 0, 0, 0, 0.6, 0.801)))[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
