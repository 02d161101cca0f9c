"""Cells of SE(3) near the object's surface, made from the codebook.

Particles already know their nearest codebook entry. Grouping the entries once into cells of a fixed size gives
every particle its cell by one look-up, whatever their number; counting and clustering then work on cells.
"""

from __future__ import annotations

import numba
import numpy as np

from .lookup import PoseLookup, squared_distance


class Regions:
    """Groups of codebook entries within `radius` [m] of the group's centre; 1 rad counts as 10 mm.

    Attributes: of_entry (M,) int32, the region of each codebook entry; centre (K,) int32, the entry in the middle
    of each region; start (K + 1,), neighbours: compressed rows of the regions adjacent to each region.
    """

    def __init__(self, lookup: PoseLookup, radius: float):
        self.of_entry, self.centre = _cover(lookup.records, lookup.neighbours, np.float32(radius**2))
        # neighbours that far apart only tell that the codebook is coarse there
        edges = (lookup.neighbour_distance < 3 * radius).ravel()
        source = np.repeat(self.of_entry, lookup.neighbours.shape[1])[edges].astype(np.int64)
        target = self.of_entry[lookup.neighbours.ravel()][edges].astype(np.int64)
        count = len(self.centre)
        pairs = np.concatenate([source * count + target, target * count + source])
        source, target = np.divmod(np.unique(pairs[np.tile(source != target, 2)]), count)
        self.neighbours = target.astype(np.int32)
        self.start = np.searchsorted(source, np.arange(count + 1)).astype(np.int64)

    def __len__(self) -> int:
        return len(self.centre)


@numba.njit(cache=True)
def _cover(records, neighbours, squared_radius):
    """Take the first entry left as a centre and everything left within the radius of it, until nothing is left.

    What lies within the radius is reached through the neighbour graph.
    """
    count = records.shape[0]
    of_entry, centre = np.full(count, -1, np.int32), np.empty(count, np.int32)
    stack = np.empty(count, np.int32)
    regions = 0
    for i in range(count):
        if of_entry[i] >= 0:
            continue
        c = records[i]
        of_entry[i], centre[regions], stack[0] = regions, i, i
        height = 1
        while height > 0:
            height -= 1
            for other in neighbours[stack[height]]:
                if of_entry[other] >= 0:
                    continue
                if squared_distance(c[0], c[1], c[2], c[4], c[5], c[6], c[7], records[other]) <= squared_radius:
                    of_entry[other] = regions
                    stack[height] = other
                    height += 1
        regions += 1
    return of_entry, centre[:regions].copy()
