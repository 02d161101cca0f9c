"""Colours, ellipsoids and trails, against what they mean."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from midastouch_tools.view.appearance import Trail, ellipsoids, scale_bar, weight_colours


def test_heavier_is_brighter_and_the_scale_does_not_matter():
    weights = np.array([0.0, 0.1, 0.4, 1.0])
    colours = weight_colours(weights)
    assert (np.diff(colours.astype(int).sum(axis=1)) > 0).all()
    np.testing.assert_array_equal(colours, weight_colours(1e-6 * weights))


def test_weights_without_any_mass_are_all_dark():
    assert weight_colours(np.zeros(3)).max() < 100
    assert weight_colours(np.zeros(0)).shape == (0, 3)


def test_ellipsoids_are_two_sigma_along_their_axes():
    rotation = Rotation.from_euler("xyz", [0.3, -0.7, 1.9]).as_matrix()
    sigmas = np.array([0.001, 0.004, 0.009])
    covariances = np.stack([rotation @ np.diag(sigmas**2) @ rotation.T, np.zeros((3, 3))])
    half, quaternions = ellipsoids(covariances)
    np.testing.assert_allclose(half[0], 2 * sigmas, rtol=1e-9)
    assert (half[1] > 0).all()  # what has no extent can still be seen
    axes = Rotation.from_quat(quaternions[0]).as_matrix()
    np.testing.assert_allclose(axes @ np.diag((half[0] / 2) ** 2) @ axes.T, covariances[0], atol=1e-12)


def test_a_trail_breaks_where_it_jumps_and_forgets_its_beginning():
    trail = Trail(length=6, gap=0.01)
    for x in (0.0, 0.005, 0.010, 0.200, 0.205):
        trail.add(np.array([x, 0, 0]))
    assert [strip[:, 0].tolist() for strip in trail.strips] == [[0.0, 0.005, 0.010], [0.200, 0.205]]
    for x in (0.210, 0.215, 0.220, 0.225):
        trail.add(np.array([x, 0, 0]))
    assert [len(strip) for strip in trail.strips] == [6]
    trail.clear()
    assert trail.strips == []


@pytest.mark.parametrize(("size", "words"), [(0.02, "5 mm"), (0.25, "50 mm"), (1.0, "200 mm")])
def test_the_scale_is_a_round_length_beside_the_object(size, words):
    vertices = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * [0.1, 0.5, 0.2] * size
    vertices[:2, 1] = -0.5 * size, 0.5 * size
    ends, label = scale_bar(vertices)
    assert label == words
    assert f"{1e3 * np.linalg.norm(ends[1] - ends[0]):.4g} mm" == words
    assert (ends[:, 2] < vertices[:, 2].min()).all()
