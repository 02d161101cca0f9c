"""Cells of SE(3) near the object's surface, made from the codebook.

Particles already know their nearest codebook entry. Grouping the entries once into cells of a fixed size gives
every particle its cell by one look-up, whatever their number; counting and clustering then work on cells.
"""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels

from .lookup import PoseLookup


class Regions:
    """Groups of codebook entries within `radius` [m] of the group's centre; 1 rad counts as 10 mm.

    Attributes: of_entry (M,) int32, the region of each codebook entry; centre (K,) int32, the entry in the middle
    of each region; start (K + 1,), neighbours: compressed rows of the regions adjacent to each region.
    """

    def __init__(self, lookup: PoseLookup, radius: float):
        # what lies within the radius is reached through the neighbour graph
        self.of_entry, self.centre = kernels.cover_regions(lookup.records, lookup.neighbours, radius**2)
        # neighbours that far apart only tell that the codebook is coarse there
        edges = (lookup.neighbour_distance < 3 * radius).ravel()
        source = np.repeat(self.of_entry, lookup.neighbours.shape[1])[edges].astype(np.int64)
        target = self.of_entry[lookup.neighbours.ravel()][edges].astype(np.int64)
        source, target = source[apart := source != target], target[apart]
        count = len(self.centre)
        # sorted by hand: the hash table of np.unique takes ten times as long
        pairs = np.sort(np.concatenate([source * count + target, target * count + source]))
        source, target = np.divmod(pairs[np.diff(pairs, prepend=-1) > 0], count)
        self.neighbours = target.astype(np.int32)
        self.start = np.searchsorted(source, np.arange(count + 1)).astype(np.int64)

    def __len__(self) -> int:
        return len(self.centre)
