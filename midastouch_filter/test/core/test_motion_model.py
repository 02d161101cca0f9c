import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from midastouch_common import se3
from midastouch_filter.core.motion_model import Odometry


@given(arrays(float, 6, elements=st.floats(-3, 3, allow_subnormal=False)), st.floats(-4.9e-4, 4.9e-4))
def test_says_how_far_it_goes_and_makes_what_is_nearly_rigid_so(xi, stretch):
    step = se3.exp(xi * [0.1, 0.1, 0.1, 1, 1, 1])
    nearly = step.copy()
    nearly[:3, :3] *= 1 + stretch
    odometry = Odometry.from_matrix(nearly)
    rotation = odometry.transform[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(odometry.transform, step, atol=1e-3)
    assert odometry.distance == pytest.approx(np.linalg.norm(step[:3, 3]), abs=1e-6)
    assert odometry.angle == pytest.approx(se3.rotation_angle(step[:3, :3]), abs=2e-3)
    assert odometry.path == pytest.approx(odometry.distance + 0.01 * odometry.angle)
    np.testing.assert_allclose(se3.from_xyzquat(odometry.row[None].astype(float))[0], odometry.transform, atol=1e-6)


half_turns = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda axis: np.linalg.norm(axis) > 1e-3)


@given(half_turns)
@settings(max_examples=100)
def test_half_turns_about_any_axis_are_motions(axis):
    axis /= np.linalg.norm(axis)
    odometry = Odometry.from_matrix(se3.make(2 * np.outer(axis, axis) - np.eye(3), np.zeros(3)))
    assert odometry.angle == pytest.approx(np.pi, abs=1e-6)
