import numpy as np
import pytest
from matplotlib.figure import Figure

from midastouch_bringup.drawing.canvas import Camera
from midastouch_bringup.drawing.scale import draw_scale, round_length


@pytest.mark.parametrize(("extent", "words"), [(0.012, "2 mm"), (0.12, "20 mm"), (0.28, "50 mm"), (1.0, "200 mm")])
def test_a_length_is_round_and_about_a_fifth(extent, words):
    length, said = round_length(extent)
    assert said == words
    assert f"{1e3 * length:.4g} mm" == words


def test_a_scale_is_as_long_in_the_picture_as_it_says():
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.05]])
    camera = Camera.around(corners, np.array([0, -1.0, 0]), np.array([0, 0, 1.0]), 400, 300)
    axes = Figure().subplots()
    draw_scale(axes, camera)
    (line,), (text,) = axes.lines, axes.texts
    assert text.get_text() == "20 mm"
    start, end = (camera.unproject(x, y, 0.0) for x, y in line.get_xydata())
    assert np.linalg.norm(end - start) == pytest.approx(0.02)
    assert (line.get_xdata() > 0).all()
    assert (line.get_xdata() < 400).all()
    assert (line.get_ydata() < 300).all()
