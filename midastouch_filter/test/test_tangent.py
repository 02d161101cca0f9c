import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from midastouch_filter import tangent
from midastouch_perception import se3

number = st.floats(-3.0, 3.0)
vectors = st.tuples(*[number] * 6).map(np.array)


@given(vectors)
def test_exp_and_inverse_agree_with_the_array_version(xi):
    np.testing.assert_allclose(tangent.exp(xi), se3.exp(xi), atol=1e-12)
    np.testing.assert_allclose(tangent.inverse(tangent.exp(xi)) @ se3.exp(xi), np.eye(4), atol=1e-12)


@given(vectors, st.sampled_from([1.0, 1e-3, 1e-6, 0.0]))
def test_log_undoes_exp_up_to_half_a_turn(xi, scale):
    xi = xi * scale
    angle = np.linalg.norm(xi[3:])
    if angle > 3.1:
        xi[3:] *= 3.1 / angle
    np.testing.assert_allclose(tangent.log(tangent.exp(xi)), xi, atol=1e-7)


def test_log_of_half_a_turn_is_finite():
    half = se3.make(np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(se3.exp(tangent.log(half)), half, atol=1e-9)
