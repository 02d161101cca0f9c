import numpy as np

from midastouch_perception.rendering.gel_surface import sunk_in

REACH = 0.5e-3


def test_the_gel_keeps_the_object_s_shape_and_follows_beside_it(cap, real):
    height = sunk_in(cap, real.pixel_size, REACH, 1.0)
    depth = (height - cap)[cap > 0]
    np.testing.assert_allclose(depth, depth[0], rtol=1e-4)
    beside = height[80, 60:]
    assert (np.diff(beside) <= 1e-9).all(), "falls away from the contact"
    assert 0 < beside[-1] < 0.05 * depth[0]


def test_it_leaves_the_object_without_an_edge(cap, real):
    height = sunk_in(cap, real.pixel_size, REACH, 1.0)
    slopes = np.diff(height[80, 60:]) / real.pixel_size
    rim = int(np.flatnonzero(cap[80, 60:] == 0)[0])
    assert slopes[rim - 1 : rim + 2].min() > 1.1 * slopes[rim - 2], "no steeper than the object"
    assert slopes[rim + 1] < 0.4 * slopes[rim - 2], "nor flat at once"


def test_stiff_gel_ends_at_the_outline_and_whole_contacts_have_none(cap, real):
    np.testing.assert_array_equal(sunk_in(cap, real.pixel_size, REACH, 0.0), cap)
    whole = np.full_like(cap, 1e-3)
    np.testing.assert_array_equal(sunk_in(whole, real.pixel_size, REACH, 1.0), whole)
    assert not sunk_in(np.zeros_like(cap), real.pixel_size, REACH, 1.0).any()
