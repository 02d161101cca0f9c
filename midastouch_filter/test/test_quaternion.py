import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from midastouch_filter import quaternion


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.998))
def test_the_principal_axis_is_the_eigenvector_of_the_largest_eigenvalue(seed, ratio):
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    values = np.array([1.0, ratio, *(ratio * rng.random(2))]) * 10 ** rng.uniform(-6, 6)
    found = quaternion.principal_axis(axes @ np.diag(values) @ axes.T)
    assert abs(found @ axes[:, 0]) == pytest.approx(1, abs=1e-9)


def test_between_equal_eigenvalues_it_is_a_vector_of_their_space():
    """Particles half a turn apart: the mean rotation is arbitrary, but it is one."""
    found = quaternion.principal_axis(np.diag([0.5, 0.0, 0.5, 0.0]))
    assert np.linalg.norm(found) == pytest.approx(1)
    assert found[1] == found[3] == 0


def test_of_nothing_it_is_no_turn():
    np.testing.assert_array_equal(quaternion.principal_axis(np.zeros((4, 4))), [0, 0, 0, 1])


@given(st.integers(0, 2**32 - 1))
def test_matrices_and_quaternions_are_the_same_rotation(seed):
    q = np.random.default_rng(seed).standard_normal(4)
    q /= np.linalg.norm(q)
    matrix = quaternion.to_matrix(q)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert abs(quaternion.from_matrix(matrix) @ q) == pytest.approx(1, abs=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_the_rotation_vector_is_scipys(seed):
    q = np.random.default_rng(seed).standard_normal(4)
    q /= np.linalg.norm(q)
    np.testing.assert_allclose(quaternion.rotation_vector(*q), Rotation.from_quat(q).as_rotvec(), atol=1e-9)
