import numpy as np
import pytest
import trimesh

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.surface import SurfaceGrid, signed_distance
from midastouch_filter.core.workers import Workers

WORKERS = Workers(1)


def mesh_of(shape, name="shape"):
    return ObjectMesh.from_arrays(shape.vertices, shape.faces, name)


@pytest.fixture(scope="module")
def ball():
    mesh = mesh_of(trimesh.creation.icosphere(subdivisions=4, radius=0.03))
    return mesh, SurfaceGrid(mesh, 0.006, WORKERS)


def test_signed_distance_of_a_ball(ball):
    grid = ball[1]
    directions = np.random.default_rng(0).standard_normal((2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radius = np.random.default_rng(1).uniform(0.0, 0.05, 2000)
    points = radius[:, None] * directions
    exact = np.clip(radius - 0.03, -0.006, 0.006)
    got = np.clip(grid.distance(points), -0.006, 0.006)
    np.testing.assert_allclose(got, exact, atol=1.5e-4)


def test_signed_beyond_the_edges_of_a_box():
    mesh = mesh_of(trimesh.creation.box([0.04, 0.03, 0.02]))
    grid = SurfaceGrid(mesh, 0.006, WORKERS)
    points = np.random.default_rng(0).uniform(-0.03, 0.03, (5000, 3))
    excess = np.abs(points) - [0.02, 0.015, 0.01]
    outside = np.linalg.norm(np.maximum(excess, 0), axis=1)
    exact = np.where(outside > 0, outside, excess.max(axis=1))
    np.testing.assert_allclose(signed_distance(mesh, points), exact, atol=1e-9)
    near = np.abs(exact) < 0.005
    error = grid.distance(points[near]) - exact[near]
    assert np.abs(error).mean() < 1e-4
    assert np.abs(error).max() < 1e-3  # in the rounded corners


def test_an_unknown_distance_is_infinite_and_inside_it_saturates(ball):
    points = np.array([[0.08, 0, 0], [1, 0, 0], [0, -1e6, 0], [1e30, 0, 0], [np.inf, 0, 0], [0, 0, 0]], np.float32)
    distance = ball[1].distance(points)
    assert np.isposinf(distance[:5]).all()
    np.testing.assert_allclose(distance[5], -ball[1].limit, rtol=1e-3)
    assert ball[1].limit > 0.006


@pytest.mark.parametrize("broken", ["open", "inverted", "two shells"])
def test_meshes_that_are_no_solids_work(broken):
    shape = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    if broken == "open":
        shape.update_faces(shape.triangles_center[:, 2] < 0.025)
    elif broken == "inverted":
        shape.invert()
    else:
        shape = trimesh.util.concatenate([shape, shape.copy().apply_translation([0.02, 0, 0])])
    mesh = mesh_of(shape)
    grid = SurfaceGrid(mesh, 0.006, WORKERS)
    points, normals, _ = mesh.sample_surface(500, np.random.default_rng(0))
    inside = grid.distance(points - 1e-3 * normals)
    assert np.isfinite(inside).all()
    assert (np.abs(inside) < 2.5e-3).mean() > 0.99
    assert (inside < 0).mean() > (0.85 if broken == "two shells" else 0.99)
