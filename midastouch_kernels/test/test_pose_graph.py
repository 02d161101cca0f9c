"""Links of the codebook's graph, and walks along them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import midastouch_kernels as kernels

COUNT, CANDIDATES, LINKS = 3000, 64, 32
TURN = np.array([0, 0, 0, 1], np.float32)


def chosen(positions: np.ndarray) -> np.ndarray:
    """Links of entries that differ in position (M, 3) only."""
    distance, index = cKDTree(positions).query(positions, k=CANDIDATES + 1)
    return kernels.choose_links(
        positions.astype(np.float32),
        np.ascontiguousarray(index[:, 1:], np.int32),
        np.ascontiguousarray(distance[:, 1:], np.float32),
        LINKS,
    )


@pytest.fixture
def positions():
    return np.random.default_rng(0).uniform(-0.05, 0.05, (COUNT, 3)).astype(np.float32)


@pytest.fixture
def graph(positions):
    records = np.zeros((COUNT, 8), np.float32)
    records[:, :3], records[:, 4:] = positions, TURN
    links = chosen(positions)
    return kernels.PoseGraph(records, links)


def walked(graph, queries: np.ndarray, entries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    entries, distance = entries.astype(np.int32), np.empty(len(queries), np.float32)
    graph.walk(0, len(queries), queries, np.tile(TURN, (len(queries), 1)), entries, distance)
    return entries, distance


def test_links_hold_the_nearest_entry_and_no_entry_twice(positions):
    links = chosen(positions)
    nearest = cKDTree(positions).query(positions, k=2)[1][:, 1]
    assert links.shape == (COUNT, LINKS)
    np.testing.assert_array_equal(links[:, 0], nearest)
    assert (np.diff(np.sort(links, axis=1), axis=1) > 0).all()
    assert (links != np.arange(COUNT)[:, None]).all()


def test_a_walk_from_nearby_ends_at_the_nearest_entry(graph, positions):
    rng = np.random.default_rng(1)
    queries = (positions + rng.normal(0, 2e-3, positions.shape)).astype(np.float32)
    nearest = cKDTree(positions).query(queries)
    entries, distance = walked(graph, queries, np.arange(COUNT))
    assert (entries == nearest[1]).mean() > 0.999
    np.testing.assert_allclose(distance, np.linalg.norm(positions[entries] - queries, axis=1), rtol=1e-4, atol=3e-6)


def test_a_pose_within_half_of_the_shortest_link_stays(graph, positions):
    nearest = cKDTree(positions).query(positions, k=2)[0][:, 1]
    step = 0.49 * nearest[:, None] * np.array([0.6, 0, 0.8], np.float32)
    entries, _ = walked(graph, (positions + step).astype(np.float32), np.arange(COUNT))
    np.testing.assert_array_equal(entries, np.arange(COUNT))


def test_what_is_beyond_the_book_or_the_particles_is_refused(graph, positions):
    for entry in (COUNT, -1):
        with pytest.raises(ValueError, match="not there"):
            walked(graph, positions[:1], np.array([entry]))
    with pytest.raises(ValueError, match="range"):
        graph.walk(0, 2, positions[:1], TURN[None], np.zeros(1, np.int32), np.zeros(1, np.float32))
