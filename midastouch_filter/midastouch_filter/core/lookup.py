"""The codebook entry nearest to each particle (paper section 4.2, "pose-space lookup").

Distance between poses, in metres: d^2 = |t - t'|^2 + (2 r sin(angle / 2))^2 with r = 10 mm per radian, the paper's
rotation scale. Unlike the paper's scaled log map it is continuous over SO(3) and the same for rotations about any
axis. The nearest entry is found exactly in a grid of cells, ring by ring until no further ring can hold it. A particle
that moved a little since the last step is followed through the neighbour graph of the codebook instead, at a tenth of
the cost.

The graph's links are chosen as in DiskANN (Subramanya et al. 2019): of the entries around one, those in different
directions first. With the nearest entries alone the walk would get stuck at entries whose neighbours lie on one side.
"""

from __future__ import annotations

import numpy as np
from pykdtree.kdtree import KDTree

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.pose_metric import ROTATION_SCALE

from .particles import Particles
from .workers import Workers

_NEIGHBOURS = 24
_LINKS = 48
_CANDIDATES = 64  # nearest entries that links are chosen from


class NearestEntry:
    """Search for the nearest entry of any pose among the codebook's poses `T_obj_gel` (M, 4, 4).

    Attributes: poses; records (M, 8) float32, each position, 0, quaternion.
    """

    def __init__(self, poses: np.ndarray):
        self.poses = poses
        rows = se3.to_xyzquat(poses).astype(np.float32)
        self.records = np.zeros((len(rows), 8), np.float32)
        self.records[:, :3], self.records[:, 4:] = rows[:, :3], rows[:, 3:]
        self._cells = kernels.PoseCells(self.records)

    def __len__(self) -> int:
        return len(self.records)

    def exact(self, poses: np.ndarray, within: float = np.inf) -> np.ndarray:
        """Return the nearest entries (N,) int32 of poses `T_obj_gel` (N, 4, 4), in less than a microsecond each.

        The entry is `len(self)` for a pose that has no entry nearer than `within` [m].
        """
        return self._cells.nearest(np.ascontiguousarray(poses, float), within)


class PoseLookup(NearestEntry):
    """`NearestEntry` with a graph of neighbours, through which particles are followed from step to step.

    Attributes: graph, the entries as the kernels take them; neighbours (M, K) int32, the K nearest other entries of
    each entry, nearest first; spacing m, the typical distance to the nearest other entry; largest_gap m, which 99 % of
    these keep below. Raises InputError for fewer than two poses.
    """

    def __init__(self, poses: np.ndarray, workers: Workers, graph: tuple[np.ndarray, np.ndarray] | None = None):
        """Make the look-up; `graph`, if it is known, as `neighbours_and_links` returns it."""
        if len(poses) < 2:
            raise InputError(f"codebook: {len(poses)} poses; build one of at least some thousands")
        super().__init__(poses)
        self._workers = workers
        self.neighbours, links = neighbours_and_links(poses) if graph is None else graph
        self.graph = kernels.PoseGraph(self.records, links)
        nearest = kernels.pose_distances(self.records, np.ascontiguousarray(self.neighbours[:, :1]))
        self.spacing = float(np.median(nearest))
        self.largest_gap = float(np.quantile(nearest, 0.99))

    def nearest(self, poses: np.ndarray, within: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest entries (N,) of poses (N, 4, 4), and the distances (N,) [m] to them.

        A pose that has no entry nearer than `within` [m] gets any entry, at an infinite distance.
        """
        entries = self.exact(poses, within)
        found = entries < len(self)
        entries = np.where(found, entries, 0)
        rows = se3.to_xyzquat(poses)
        there = self.records[entries]
        straight = np.square(rows[:, :3] - there[:, :3]).sum(axis=1)
        cosine = np.einsum("ni,ni->n", rows[:, 3:], there[:, 4:])  # of half the angle
        distance = np.sqrt(straight + 4 * ROTATION_SCALE**2 * np.maximum(1.0 - cosine**2, 0.0))
        return entries, np.where(found, distance, np.inf)

    def around(self, entries: np.ndarray, count: int) -> np.ndarray:
        """Return entries (N, count): each of `entries` (N,), followed by those nearest to it."""
        return np.column_stack([entries, self.neighbours[entries, : count - 1]])

    def follow(self, particles: Particles) -> np.ndarray:
        """Update `particles.entries` by walking the graph from the last ones; returns the distances (N,) [m].

        Meant for particles that moved less than `reach` since.
        """
        distance = np.empty(len(particles), np.float32)
        self._workers.run(
            len(particles),
            lambda low, high, _: self.graph.walk(
                low, high, particles.positions, particles.quaternions, particles.entries, distance
            ),
        )
        return distance


def neighbours_and_links(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return neighbours (M, K) int32 of poses (M, 4, 4), nearest first, and links (M, L) int32."""
    features = _features(poses)
    candidates = min(_CANDIDATES, len(poses) - 1)
    distance, index = KDTree(features).query(features, k=candidates + 1)
    # an entry is its own nearest neighbour, unless the codebook holds the same pose twice
    keep = index != np.arange(len(poses))[:, None]
    keep[keep.all(axis=1), -1] = False
    index = index[keep].reshape(len(poses), candidates).astype(np.int32)
    distance = distance[keep].reshape(len(poses), candidates)
    links = kernels.choose_links(features, index, distance, min(_LINKS, candidates))
    return np.ascontiguousarray(index[:, :_NEIGHBOURS]), links


def space_filling_order(poses: np.ndarray) -> np.ndarray:
    """Return the order (M,) of poses (M, 4, 4) along a space-filling curve, by position.

    Entries near in space are then near in memory, which makes walking the graph several times faster.
    """
    t = poses[:, :3, 3]
    cells = ((t - t.min(axis=0)) / max(np.ptp(t, axis=0).max(), 1e-9) * 1023).astype(np.int64)
    code = np.zeros(len(t), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _features(poses: np.ndarray) -> np.ndarray:
    """Return features (N, 12) float32 whose Euclidean distance is the distance between the poses (N, 4, 4)."""
    rotation = (ROTATION_SCALE / np.sqrt(2)) * poses[:, :3, :3].reshape(-1, 9)
    return np.concatenate([poses[:, :3, 3], rotation], axis=1).astype(np.float32)
