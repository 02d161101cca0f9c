import numpy as np
import pytest

from midastouch_tools.view.clouds import shapes

from .conftest import MOMENTS


def test_what_is_not_known_is_no_layer(run):
    assert list(shapes(run.moments, 0)) == ["particles", "modes", "truth"]
    assert list(shapes(run.moments, MOMENTS - 1)) == ["particles", "modes", "contact", "estimate", "truth"]


@pytest.mark.parametrize("index", range(MOMENTS))
def test_lines_join_existing_points_and_all_have_a_colour(run, index):
    for shape in shapes(run.moments, index).values():
        assert shape.points.shape == shape.colours.shape
        assert (shape.colours >= 0).all()
        assert (shape.colours <= 1).all()
        if shape.lines is not None:
            assert shape.lines.min() >= 0
            assert shape.lines.max() < len(shape.points)


def test_a_mode_is_as_wide_as_two_of_its_deviations(run):
    """With the gel's axes of 12 mm, which reach beyond them."""
    points = shapes(run.moments, 2)["modes"].points - run.moments[2].truth[:3, 3]
    rings = points[: 3 * 48]
    np.testing.assert_allclose(np.abs(rings).max(axis=0), [2e-3, 4e-3, 6e-3], rtol=0.01)
    np.testing.assert_allclose(points[3 * 48 :].max(axis=0), 0.012)


def test_paths_grow_with_time(run):
    lengths = [np.ptp(shapes(run.moments, i)["truth"].points[:, 0]) for i in (1, 3)]
    # and the axis of the last pose
    np.testing.assert_allclose(lengths, [0.002 + 0.012, 0.006 + 0.012])
    assert shapes(run.moments, 3)["estimate"].points[:, 0].min() == pytest.approx(0.002)


def test_particles_turn_red_with_their_angle_to_the_truth(run):
    colours = shapes(run.moments, 0)["particles"].colours
    assert (colours[:, 2] > colours[:, 0]).all()  # all within a few degrees: blue
