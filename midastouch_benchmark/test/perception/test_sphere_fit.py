import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_benchmark.perception.sphere_fit import fit_sphere, principal_curvatures

CENTRE = np.array([1e-3, -2e-3, -3e-3])


def cap(radius: float, reach: float = 1.5e-3, centre=CENTRE) -> np.ndarray:
    """Points of a ball's upper side within `reach` of its top, seen from above."""
    x, y = np.meshgrid(*[np.linspace(-reach, reach, 25)] * 2)
    inside = np.hypot(x, y) < min(reach, radius)
    x, y = x[inside], y[inside]
    return centre + np.column_stack([x, y, np.sqrt(radius**2 - x**2 - y**2)])


@given(st.floats(2e-3, 3e-2))
def test_an_exact_cap(radius):
    sphere = fit_sphere(cap(radius))
    assert sphere.radius == pytest.approx(radius, rel=1e-3)
    np.testing.assert_allclose(sphere.centre, CENTRE, atol=2e-3 * radius)
    assert sphere.residual < 1e-7


def test_a_given_radius_is_kept():
    points = cap(4e-3)
    sphere = fit_sphere(points, 5e-3)
    assert sphere.radius == 5e-3
    np.testing.assert_allclose(sphere.centre[:2], CENTRE[:2], atol=1e-5)
    assert sphere.centre[2] < CENTRE[2]
    assert 0 < sphere.residual < 5e-5


def test_noise_is_the_residual():
    rng = np.random.default_rng(0)
    points = cap(4e-3)
    points[:, 2] += rng.normal(0, 2e-5, len(points))
    sphere = fit_sphere(points)
    assert sphere.residual == pytest.approx(2e-5, rel=0.15)
    assert sphere.radius == pytest.approx(4e-3, rel=0.05)


def test_curvatures_of_a_ball_are_equal():
    np.testing.assert_allclose(principal_curvatures(cap(0.01, 1e-3)), 100, rtol=0.02)


def test_curvatures_off_the_top_of_a_ball():
    """Where its side is seen at 30 deg the curvature is the same, though the depth map looks steeper."""
    points = cap(0.01, 6e-3)
    aside = points[np.hypot(points[:, 0] - CENTRE[0] - 5e-3, points[:, 1] - CENTRE[1]) < 1e-3]
    np.testing.assert_allclose(principal_curvatures(aside), 100, rtol=0.1)


def test_curvatures_tell_cylinder_dent_and_saddle():
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(-1e-3, 1e-3, 15)] * 2))
    for z, expected in ((-(x**2) / 2, (0, 1)), (x**2 + y**2, (-2, -2)), (x**2 - y**2, (-2, 2))):
        found = principal_curvatures(np.column_stack([x, y, 100 * z]))
        np.testing.assert_allclose(found / 100, expected, atol=0.02)
