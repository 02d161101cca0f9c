import numpy as np
import pytest

from midastouch_bringup.drawing.camera import Camera, best_direction


@pytest.fixture
def points() -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.1, 0.1, (200, 3)) * [1, 0.5, 0.2]


@pytest.mark.parametrize("direction", [[1, 2, 3], [0, 0, 1], [0, -1, 0]])
def test_every_point_is_in_the_picture_and_fills_it(points, direction):
    camera = Camera.around(points, np.array(direction), np.array([0, 0, 1.0]), 400, 300)
    assert camera.rotation @ camera.rotation.T == pytest.approx(np.eye(3))
    assert np.linalg.det(camera.rotation) == pytest.approx(1)
    pixels, _ = camera.project(points)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    assert (low >= 0).all()
    assert (high <= [400, 300]).all()
    assert max((high - low) / [400, 300]) > 0.9


def test_unproject_undoes_project(points):
    camera = Camera.around(points, np.array([1.0, 2, 3]), np.array([0, 0, 1.0]), 400, 300)
    pixels, heights = camera.project(points)
    assert camera.unproject(pixels[:, 0], pixels[:, 1], heights) == pytest.approx(points)


def test_up_is_up_and_right_is_right():
    camera = Camera.around(np.eye(3) * 0.1, np.array([0, -1.0, 0]), np.array([0, 0, 1.0]), 100, 100)
    centre = camera.project(camera.centre)[0]
    assert camera.project(camera.centre + np.array([0, 0, 0.01]))[0][1] < centre[1]
    assert camera.project(camera.centre + np.array([0.01, 0, 0]))[0][0] > centre[0]


def test_scaled_cameras_see_the_same(points):
    camera = Camera.around(points, np.array([1.0, 2, 3]), np.array([0, 0, 1.0]), 400, 300)
    assert camera.scaled(2).project(points)[0] == pytest.approx(2 * camera.project(points)[0])


def test_the_best_direction_faces_the_surface():
    normals = np.array([[1.0, 0, 0], [0.9, 0.1, 0.1], [0.9, -0.1, 0]])
    assert best_direction(normals) @ [1, 0, 0] > 0.9
