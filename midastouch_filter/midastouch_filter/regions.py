"""Cells of SE(3) near the object's surface, made from the codebook.

Particles already know their nearest codebook entry. Grouping the entries once into cells of a fixed size gives
every particle its cell by one look-up, whatever their number; counting and clustering then work on cells.
"""

from __future__ import annotations

import numpy as np

from .lookup import ROTATION_SCALE, PoseLookup

_AXIS_BITS = 10


class Regions:
    """Groups of codebook entries within cells of edge `size` [m]; 1 rad counts as 10 mm.

    Attributes: of_entry (M,) int32, the region of each codebook entry; centre (K,) int32, the entry that stands
    for each region; start (K + 1,), neighbours: compressed rows of the regions adjacent to each region.
    """

    def __init__(self, lookup: PoseLookup, poses: np.ndarray, size: float):
        # two axes determine a rotation; a step of size/r in an axis is a turn of about size in metres
        axes = poses[:, :3, [0, 2]].reshape(-1, 6) * (ROTATION_SCALE / size)
        cells = np.floor(np.concatenate([poses[:, :3, 3] / size, axes], axis=1)).astype(np.int64)
        cells -= cells.min(axis=0)
        of_entry = np.unique(_pack(cells), return_inverse=True)[1]
        self.of_entry = of_entry.astype(np.int32)
        self.centre = _most_central(lookup, self.of_entry)
        # neighbours farther apart than three cells only tell that the codebook is coarse there
        edges = lookup.neighbour_distance < 3 * size
        source = np.repeat(self.of_entry, lookup.neighbours.shape[1])[edges.ravel()]
        target = self.of_entry[lookup.neighbours.ravel()][edges.ravel()]
        count = len(self.centre)
        pairs = np.unique(np.concatenate([source * np.int64(count) + target, target * np.int64(count) + source]))
        source, target = pairs // count, pairs % count
        apart = source != target
        self.neighbours = target[apart].astype(np.int32)
        self.start = np.searchsorted(source[apart], np.arange(count + 1)).astype(np.int64)

    def __len__(self) -> int:
        return len(self.centre)


def _pack(cells: np.ndarray) -> np.ndarray:
    """One sortable number (M,) per row of small non-negative integers (M, 9)."""
    _, packed = np.unique(cells[:, :3] @ (1 << _AXIS_BITS * np.arange(3)), return_inverse=True)
    for column in cells[:, 3:].T:
        packed = packed * (column.max() + 1) + column
    return packed


def _most_central(lookup: PoseLookup, of_entry: np.ndarray) -> np.ndarray:
    """For each region the entry (K,) nearest to the mean position of its entries."""
    size = np.bincount(of_entry)
    positions = lookup.records[:, :3].astype(float)
    mean = np.stack([np.bincount(of_entry, weights=p) for p in positions.T], axis=1) / size[:, None]
    off = np.linalg.norm(positions - mean[of_entry], axis=1)
    order = np.lexsort((off, of_entry))
    return order[np.concatenate([[0], np.cumsum(size)[:-1]])].astype(np.int32)
