import numpy as np
import pytest

from midastouch_tools.drawing.canvas import Camera, Canvas, best_direction

RED, GREEN = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])


@pytest.fixture
def canvas(ball) -> Canvas:
    """The ball seen from +x, 100 x 100 px."""
    canvas = Canvas(Camera.around(ball.vertices, np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), 100, 100))
    canvas.draw_mesh(ball)
    return canvas


def reddish(image: np.ndarray) -> np.ndarray:
    image = image.astype(int)
    return (image[..., 0] > image[..., 1] + 60) & (image[..., 0] > image[..., 2] + 60)


def test_a_ball_covers_its_disc(canvas):
    image = canvas.image()
    assert image.shape == (100, 100, 3)
    covered = (image < 250).any(axis=-1).mean()
    assert covered == pytest.approx(np.pi / 4 / 1.06**2, rel=0.02)


def test_light_comes_from_above(canvas):
    image = canvas.image().astype(int)
    assert image[20, 50].sum() > image[80, 50].sum() + 60


def test_surface_points_lie_on_the_ball(canvas):
    points = canvas.surface_points()
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.full(len(points), 0.03), rel=0.01)
    assert (points[:, 0] > -0.001).all()


def test_paint_colours_point_by_point(canvas):
    points = canvas.surface_points()
    canvas.paint(np.where(points[:, 2:] > 0, RED, GREEN))
    image = canvas.image().astype(int)
    assert image[25, 50, 0] > image[25, 50, 1] + 60
    assert image[75, 50, 1] > image[75, 50, 0] + 60


@pytest.mark.parametrize(("x", "shown"), [(0.03, True), (-0.03, False)])
def test_the_ball_hides_what_lies_behind_it(canvas, x, shown):
    canvas.draw_points(np.array([[x, 0, 0]]), RED, radius=4, alpha=1.0, hidden_alpha=0.0)
    assert reddish(canvas.image()).any() == shown


def test_pressed_in_poses_stay_visible(canvas):
    canvas.draw_points(np.array([[0.028, 0, 0]]), RED, radius=4, alpha=1.0, hidden_alpha=0.0)
    assert reddish(canvas.image())[50, 50]


def test_nearer_points_cover_farther_ones(canvas):
    points = np.array([[0.05, 0, 0], [0.04, 0, 0]])
    canvas.draw_points(points, np.array([RED, GREEN]), radius=4, alpha=1.0)
    assert reddish(canvas.image())[50, 50]


def test_points_outside_the_picture_are_no_error(canvas):
    before = canvas.image()
    canvas.draw_points(np.array([[0.0, 5.0, 5.0]]), RED)
    canvas.draw_points(np.zeros((0, 3)), RED)
    assert (canvas.image() == before).all()


def test_a_copy_is_drawn_on_separately(canvas):
    before = canvas.image()
    canvas.copy().draw_axes(np.eye(4), 0.05)
    assert (canvas.image() == before).all()


def test_an_ellipse_has_the_size_of_its_covariance(canvas):
    canvas.draw_ellipse(np.array([0.03, 0, 0]), np.diag([1e-6, 25e-6, 1e-6]), RED)
    columns = np.nonzero(reddish(canvas.image()))[1]
    assert np.ptp(columns) * 2 * canvas.camera.pixel_size == pytest.approx(2 * 2 * 5e-3, rel=0.15)


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
