import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from midastouch_tools.drawing.canvas import Camera
from midastouch_tools.drawing.scale import INK, draw_scale, round_length


@pytest.mark.parametrize(("extent", "words"), [(0.012, "2 mm"), (0.12, "20 mm"), (0.28, "50 mm"), (1.0, "200 mm")])
def test_a_length_is_round_and_about_a_fifth(extent, words):
    length, said = round_length(extent)
    assert said == words
    assert f"{1e3 * length:.4g} mm" == words


@pytest.fixture
def camera() -> Camera:
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.05]])
    return Camera.around(corners, np.array([0, -1.0, 0]), np.array([0, 0, 1.0]), 400, 300)


def test_a_scale_is_read_on_an_object_of_its_own_colour(camera):
    canvas = FigureCanvasAgg(Figure(facecolor=INK))
    axes = canvas.figure.add_axes((0, 0, 1, 1), frameon=False)
    draw_scale(axes, camera)
    canvas.draw()
    (text,) = axes.texts
    (left, below), (right, above) = text.get_window_extent().get_points().round().astype(int)
    brightness = np.asarray(canvas.buffer_rgba())[::-1, :, :3].min(axis=2)
    label = brightness[below:above, left:right]
    assert label.max() > 240
    assert label.min() < 90  # the letters themselves


def test_a_scale_is_as_long_in_the_picture_as_it_says(camera):
    axes = Figure().subplots()
    draw_scale(axes, camera)
    (line,), (text,) = axes.lines, axes.texts
    assert text.get_text() == "20 mm"
    start, end = (camera.unproject(x, y, 0.0) for x, y in line.get_xydata())
    assert np.linalg.norm(end - start) == pytest.approx(0.02)
    assert (line.get_xdata() > 0).all()
    assert (line.get_xdata() < 400).all()
    assert (line.get_ydata() < 300).all()
