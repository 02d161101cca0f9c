"""The nearest entry against every entry."""

from __future__ import annotations

import numpy as np
import pytest

import midastouch_kernels as kernels


def random_poses(n: int, rng: np.random.Generator, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses (n, 4, 4), and as records (n, 8)."""
    vectors = rng.normal(size=(n, 6)) * [spread, spread, 0.1 * spread, 1, 1, 1]
    poses = kernels.exponentials(vectors)
    records = np.zeros((n, 8), np.float32)
    records[:, :3], records[:, 4:] = poses[:, :3, 3], kernels.quaternions(poses)
    return poses, records


def distances(poses: np.ndarray, entries: np.ndarray) -> np.ndarray:
    """(n, m) [m] between poses (n, 4, 4) and entries (m, 4, 4), by the definition of the distance."""
    chord = ((poses[:, None, :3, :3] - entries[None, :, :3, :3]) ** 2).sum(axis=(2, 3))
    return np.sqrt(((poses[:, None, :3, 3] - entries[None, :, :3, 3]) ** 2).sum(axis=2) + 0.5 * 0.01**2 * chord)


@pytest.mark.parametrize("count", [1, 7, 3000])
@pytest.mark.parametrize("away", [0.0, 0.2, 3.0], ids=lambda metres: f"{metres} m away")
def test_nearest_is_the_nearest(count, away):
    rng = np.random.default_rng(count)
    entries, records = random_poses(count, rng, 0.05)
    queries = random_poses(200, rng, 0.07)[0]
    queries[:, :3, 3] += away * np.array([0.6, -0.64, 0.48])
    distance = distances(queries, entries)
    found = kernels.PoseCells(records).nearest(queries, np.inf)
    least = distance.min(axis=1)
    np.testing.assert_allclose(distance[np.arange(200), found], least, rtol=1e-5, atol=1e-6)
    bound = np.median(least)
    bounded = kernels.PoseCells(records).nearest(queries, bound)
    clear = abs(least - bound) > 1e-5
    np.testing.assert_array_equal((bounded == count)[clear], (least > bound)[clear])


def test_particles_are_located_at_the_same_entries():
    rng = np.random.default_rng(2)
    cells, (poses, rows) = kernels.PoseCells(random_poses(3000, rng, 0.05)[1]), random_poses(200, rng, 0.07)
    particles = np.ascontiguousarray(rows[:, :3]), np.ascontiguousarray(rows[:, 4:])
    entries = np.full(200, -1, np.int32)
    cells.locate(50, 150, *particles, entries)
    np.testing.assert_array_equal(entries[50:150], cells.nearest(poses, np.inf)[50:150])
    assert (entries[:50] == -1).all()
    assert (entries[150:] == -1).all()
    with pytest.raises(ValueError, match="range"):
        cells.locate(0, 201, *particles, entries)


def test_entries_all_at_one_place():
    poses, records = random_poses(50, np.random.default_rng(1), 0.0)
    np.testing.assert_array_equal(kernels.PoseCells(records).nearest(poses, np.inf), np.arange(50))


def test_what_is_no_place_has_nothing_near():
    _, records = random_poses(5, np.random.default_rng(1), 0.05)
    assert kernels.PoseCells(records).nearest(np.full((1, 4, 4), np.nan), np.inf) == 5
    with pytest.raises(ValueError, match="not finite"):
        kernels.PoseCells(np.full((1, 8), np.nan, np.float32))
    with pytest.raises(ValueError, match="at least one"):
        kernels.PoseCells(np.empty((0, 8), np.float32))
