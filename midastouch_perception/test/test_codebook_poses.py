import numpy as np
import pytest
from scipy.spatial import cKDTree

from midastouch_perception.codebook_poses import PRESS, YAWS, codebook_poses
from midastouch_perception.simulation.renderer import PenetrationRenderer


@pytest.fixture(scope="module")
def poses(tool, sensor):
    return codebook_poses(tool, 4000, sensor, np.random.default_rng(0))


def test_covers_the_surface_without_holes(poses, tool):
    """Every reachable surface point has an entry within about two mean spacings."""
    points, _, _ = tool.sample_surface(2000, np.random.default_rng(1))
    contact = poses[:, :3, 3] + PRESS * poses[:, :3, 2]
    spacing = np.sqrt(tool.area / (len(poses) / YAWS))
    distance = cKDTree(contact).query(points)[0]
    assert np.quantile(distance, 0.98) < 1.5 * spacing


def test_yaw_is_even(poses):
    contact = (poses[:, :3, 3] + PRESS * poses[:, :3, 2]).round(6)
    _, site, count = np.unique(contact, axis=0, return_inverse=True, return_counts=True)
    full = np.flatnonzero(count == YAWS)
    assert len(full) > 50
    for index in full[:20]:
        here = poses[site.reshape(-1) == index]
        turns = np.arctan2(here[:, :3, 0] @ here[0, :3, 1], here[:, :3, 0] @ here[0, :3, 0])
        np.testing.assert_allclose(np.diff(np.sort(turns)), 2 * np.pi / YAWS, atol=1e-6)


def test_entries_touch(poses, tool, sensor):
    deepest = PenetrationRenderer(tool, sensor.scaled(0.25)).render(poses).max(axis=(1, 2))
    assert (deepest > 2e-4).mean() > 0.97
    assert deepest.max() < 2.2e-3


def test_sizes_are_exact(tool, sensor):
    for size in (1, 5, 17, 333):
        assert len(codebook_poses(tool, size, sensor, np.random.default_rng(0))) == size
