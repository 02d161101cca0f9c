import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_simulation import bundled_meshes
from midastouch_simulation.procedural import (
    box,
    cylinder,
    difference,
    mesh_from_sdf,
    placed,
    random_shape,
    sphere,
    torus,
    union,
)


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (sphere(0.01), 4 * np.pi * 1e-4),
        (box((0.01, 0.008, 0.006)), 8 * (80 + 60 + 48) * 1e-6),
        (cylinder(0.008, 0.01), 2 * np.pi * 0.008 * (0.008 + 0.02)),
        (torus(0.009, 0.003), 4 * np.pi**2 * 0.009 * 0.003),
    ],
)
def test_surface_nets_have_the_right_area_and_face_outward(shape, area):
    mesh = mesh_from_sdf(shape, np.full(3, 0.013), 4e-4, "shape")
    assert mesh.area == pytest.approx(area, rel=0.04)
    points, normals, _ = mesh.sample_surface(300, np.random.default_rng(0))
    outside = shape(points + 5e-4 * normals)
    assert (outside > 0).mean() > 0.99


def test_union_difference_and_random_shapes():
    a, b = sphere(0.01), placed(sphere(0.01), se3.translation([0.01, 0, 0]))
    points = np.random.default_rng(0).uniform(-0.02, 0.02, (200, 3))
    np.testing.assert_array_equal(union(a, b)(points) < 0, (a(points) < 0) | (b(points) < 0))
    np.testing.assert_array_equal(difference(a, b)(points) < 0, (a(points) < 0) & (b(points) > 0))
    assert (union(a, b, blend=0.003)(points) <= union(a, b)(points) + 1e-12).all()
    first, second = (random_shape(np.random.default_rng(3), "x") for _ in range(2))
    assert first.sha256 == second.sha256
    assert 0.02 < first.diagonal < 0.25


def test_bundled_meshes_are_what_the_generator_makes():
    assert set(bundled_objects()) == {"ball", "eyebolt", "handle_tool", "star_knob"}
    for name, path in bundled_objects().items():
        made = getattr(bundled_meshes, name)()
        np.testing.assert_allclose(ObjectMesh.load(path).vertices, made.vertices, atol=1e-6)
