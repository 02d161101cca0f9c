import numpy as np
import pytest

from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.simulation.optics import Illumination, TactoOptics, gel_normals, render_gel


@pytest.fixture(scope="module")
def pressed(tool, sensor):
    from midastouch_perception.rendering.contact_poses import sample_contact_poses

    renderer = PenetrationRenderer(tool, sensor)
    penetration, normals = renderer.render_with_normals(sample_contact_poses(tool, 1, np.random.default_rng(5), sensor))
    return penetration[0], normals[0]


def test_gel_normals_are_the_dome_s(sensor):
    """Against the analytic normal of the ellipsoid cap."""
    tangent_x, tangent_y = sensor.rays
    depth = sensor.gel_depth
    x, y = tangent_x * depth, tangent_y * depth
    dome = dict(sensor.dome)
    c = dome["semi_axis_z"]
    root = np.sqrt(1 - x**2 / (c * dome["radius_x"]) - y**2 / (c * dome["radius_y"]))
    expected = np.stack([-x / (dome["radius_x"] * root), -y / (dome["radius_y"] * root), np.ones_like(x)], axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(gel_normals(sensor)[2:-2, 2:-2], expected[2:-2, 2:-2], atol=2e-3)


def test_undeformed_gel_has_tacto_s_colours(sensor):
    """Each spot shines across the gel: red, from the right, lights the left; dim, far from saturation."""
    image = render_gel(np.zeros((320, 240), np.float32), None, sensor, Illumination.tacto())
    red, green, blue = np.moveaxis(image, -1, 0)
    assert red[:, 40].mean() > red[:, 200].mean()
    assert green[:, 200].mean() > green[:, 40].mean()
    assert blue[40].mean() > blue[280].mean()
    assert 40 < image.mean() < 160
    assert image.max() < 250


def test_no_contact_changes_nothing(sensor):
    optics = TactoOptics(sensor)
    assert np.abs(optics.difference(np.zeros((320, 240), np.float32))).max() < 1e-3


def test_contact_changes_the_image_where_it_is(pressed, sensor):
    penetration, normals = pressed
    change = np.abs(TactoOptics(sensor).difference(penetration, normals)).max(axis=2)
    assert change[penetration > 0].mean() > 3
    assert change[penetration == 0].mean() < 0.5


def test_slopes_stand_in_for_normals(pressed, sensor):
    penetration, normals = pressed
    optics = TactoOptics(sensor)
    with_normals, without = optics.difference(penetration, normals), optics.difference(penetration)
    assert np.corrcoef(with_normals.ravel(), without.ravel())[0, 1] > 0.9


def test_image_is_background_plus_change_plus_noise(pressed, sensor):
    penetration, normals = pressed
    optics = TactoOptics(sensor)
    background = np.full((320, 240, 3), 120, np.uint8)
    image = optics.image(penetration, background, np.random.default_rng(0), normals)
    assert image.dtype == np.uint8
    residual = image - np.floor(optics.difference(penetration, normals) + background)
    assert residual.std() == pytest.approx(2.0, abs=0.1)
    np.testing.assert_array_equal(image, optics.image(penetration, background, np.random.default_rng(0), normals))
