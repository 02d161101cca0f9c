"""Rays against a surface; closest points are tested with the mesh that answers them."""

import numpy as np
import trimesh

from midastouch_common.surface_search import RaySearch


def test_only_rays_from_within_a_closed_surface_meet_it():
    """Faces of a tenth of a millimetre, as a scan of a small part has them."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=4e-3)
    search = RaySearch(ball.vertices, ball.faces)
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((1000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert search.meets(rng.uniform(-2e-3, 2e-3, (1000, 3)), directions).all()
    assert not search.meets(5e-3 * directions, directions).any()
    assert search.meets(5e-3 * directions, -directions).all()
    assert search.meets(np.empty((0, 3)), np.empty((0, 3))).shape == (0,)
