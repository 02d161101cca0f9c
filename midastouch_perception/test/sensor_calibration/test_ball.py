import numpy as np
import pytest
import trimesh

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel

REAL = SensorModel.load("digit_real").scaled(0.5)


def test_as_the_renderer_renders_it():
    radius = 4e-3
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    renderer = PenetrationRenderer(ObjectMesh.from_arrays(mesh.vertices, mesh.faces, "ball"), REAL)
    for u, v in ((60, 80), (30, 120), (100, 20)):
        centre = ball_centre(u, v, 2e-3, radius, REAL)
        rendered = renderer.render(se3.translation(-centre)[None])[0]
        np.testing.assert_allclose(np.maximum(ball_penetration(centre, radius, REAL), 0), rendered, atol=1.5e-5)


@pytest.mark.parametrize("contact", [0.8e-3, 1.5e-3, 2.5e-3])
@pytest.mark.parametrize("place", [(60, 80), (40, 110), (75, 40)])
def test_the_contact_is_where_and_as_wide_as_asked_for(contact, place):
    touched = ball_penetration(ball_centre(*place, contact, 3e-3, REAL), 3e-3, REAL) > 0
    rows, columns = np.nonzero(touched)
    assert np.hypot(columns.mean() - place[0], rows.mean() - place[1]) * REAL.pixel_size < 0.15e-3
    assert np.sqrt(touched.sum() * REAL.pixel_area / np.pi) == pytest.approx(contact, rel=0.06)
