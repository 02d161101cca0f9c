import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from midastouch_benchmark.perception.press_quality import (
    cap_penetration,
    circle_outline,
    fit_sphere,
    mask_outline,
    nearest_cap,
    principal_curvatures,
)
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

RADIUS = 4.4e-3


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_real").scaled(0.5)


def centre(sensor, x=1e-3, y=-2e-3, depth=1.2e-3):
    return np.array([x, y, sensor.sag(x, y) + depth - RADIUS])


def test_a_ball_as_the_renderer_sees_it(sensor):
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=RADIUS)
    renderer = PenetrationRenderer(ObjectMesh.from_arrays(mesh.vertices, mesh.faces, "ball"), sensor)
    rendered = renderer.render(se3.translation(-centre(sensor))[None])[0]
    np.testing.assert_allclose(cap_penetration(centre(sensor), RADIUS, sensor), rendered, atol=3e-6)
    assert rendered.max() == pytest.approx(1.2e-3, rel=0.02)


def test_out_of_reach_nothing_is_touched(sensor):
    assert not cap_penetration([0, 0, -2 * RADIUS], RADIUS, sensor).any()
    assert not cap_penetration([0.1, 0, -RADIUS], RADIUS, sensor).any()


@pytest.mark.parametrize(("x", "y", "depth"), [(0, 0, 1e-3), (3e-3, 4e-3, 1.5e-3), (5e-3, -7e-3, 0.5e-3)])
def test_an_outline_tells_the_ball(sensor, x, y, depth):
    """Also where the image cuts the contact off: its outline is that of the gel, not of the image."""
    truth = centre(sensor, x, y, depth)
    outline = mask_outline(cap_penetration(truth, RADIUS, sensor) > 0, sensor)
    found = fit_sphere(outline, RADIUS)
    np.testing.assert_allclose(found.centre, truth, atol=6e-5)  # half a pixel
    assert found.residual < 6e-5


def test_a_circle_of_the_camera_image_tells_the_ball(sensor):
    """A cap at the gel's apex is a circle in the image; a label's pixel is the one that its centre falls into."""
    truth = centre(sensor, 0, 0, 1e-3)
    contact = cap_penetration(truth, RADIUS, sensor.scaled(2)) > 0
    rows, columns = np.nonzero(contact)
    circle = (columns.mean(), rows.mean(), np.sqrt(contact.sum() / np.pi))
    np.testing.assert_allclose(fit_sphere(circle_outline(circle, 0.5, sensor), RADIUS).centre, truth, atol=2e-5)


def test_a_circle_wider_than_the_ball_misses_it(sensor):
    wide = circle_outline((120, 160, 100), 0.5, sensor)  # 5.4 mm
    assert fit_sphere(wide, RADIUS).residual > 3e-4


def test_the_nearest_cap_of_a_cap_is_itself(sensor):
    truth = centre(sensor)
    measured = cap_penetration(truth, RADIUS, sensor)
    np.testing.assert_allclose(nearest_cap(measured, measured > 0, RADIUS, sensor), truth, atol=5e-6)


def test_the_nearest_cap_of_one_pixel(sensor):
    measured = np.zeros((160, 120), np.float32)
    measured[80, 60] = 2e-4
    assert np.isfinite(nearest_cap(measured, measured > 0, RADIUS, sensor)).all()


CENTRE = np.array([1e-3, -2e-3, -3e-3])


def cap(radius: float, reach: float = 1.5e-3) -> np.ndarray:
    """Points of a ball's upper side within `reach` of its top, seen from above."""
    x, y = np.meshgrid(*[np.linspace(-reach, reach, 25)] * 2)
    inside = np.hypot(x, y) < min(reach, radius)
    x, y = x[inside], y[inside]
    return CENTRE + np.column_stack([x, y, np.sqrt(radius**2 - x**2 - y**2)])


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
