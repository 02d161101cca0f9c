"""Modes of the particle set: clustering in position and rotation (paper section 4.3, "hypothesis clustering").

The paper runs DBSCAN on positions, which needs every pair of particles that lie together: seconds at 10k converged
particles. Here the particles are counted in regions, cells of SE(3) near the object's surface that are made from the
codebook once: particles already know their nearest codebook entry, so that each finds its region by one look-up. The
mass of each region is summed once, and peaks of the mass are found on the graph of regions (ToMATo: Chazal, Guibas,
Oudot and Skraba 2013), so that the cost beyond one pass over the particles depends on the number of occupied regions
only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels

from .lookup import PoseLookup
from .particles import Particles
from .workers import CHUNKS, Workers

_MOST_MODES = 64  # reported; the mass of any further ones counts as "rest"

# while particles are spread all over, only the heaviest regions can belong to a mode worth reporting; the mass of the
# others counts as "rest"
_MOST_REGIONS = 4096

_SUMS = 65  # numbers that `kernels.sum_modes` adds up per mode: an (8, 8) matrix and a count


@dataclass(frozen=True)
class Moments:
    """Weighted sums over the particles of each of m modes, sorted by mass, heaviest first.

    reference (m, 7): position and quaternion that the sums are relative to (quaternions are flipped to its side);
    mass (m,); count (m,) particles; square (m, 8, 8): mean of x x' for x = (1, position, quaternion), the position
    relative to the reference [m].
    """

    reference: np.ndarray
    mass: np.ndarray
    count: np.ndarray
    square: np.ndarray


class ModeFinder:
    """Clusters particles over the regions of one codebook.

    Args: radius [m]: peaks nearer than this may be merged into one mode (1 rad counts as 10 mm); min_mass: modes
    lighter than this are left out, except for the heaviest.
    Attributes: peaks, region at the peak of each mode of the latest moments: tells modes apart when masses change.
    """

    def __init__(self, lookup: PoseLookup, regions: Regions, radius: float, min_mass: float, workers: Workers):
        self._regions, self._workers = regions, workers
        self._centres = np.ascontiguousarray(lookup.records[regions.centre])
        self._squared_radius, self._min_mass = radius**2, min_mass

    def find(self, particles: Particles, weights: np.ndarray) -> Moments:
        """Moments of the modes of particles with normalised weights (N,)."""
        mass = kernels.region_mass(self._regions.of_entry, particles.entries, weights, len(self._regions))
        self._regions_of_peaks, self._mode_of_region = self._cluster(mass)
        return self.moments(particles, weights)

    def moments(self, particles: Particles, weights: np.ndarray) -> Moments:
        """Moments of the modes found last, for particles that were moved or weighed since; weights (N,)."""
        moments, order = self._sum(particles, weights, self._regions_of_peaks, self._mode_of_region)
        self.peaks = self._regions_of_peaks[order].tolist()
        self._rank = np.full(len(order) + 1, -1, np.int32)  # the last stands for -1: no mode
        self._rank[order] = np.arange(len(order), dtype=np.int32)
        return moments

    def members(self, particles: Particles) -> np.ndarray:
        """Mode (N,) int32 of each particle, numbered as the latest moments, -1 for none."""
        return kernels.members(particles.entries, self._regions.of_entry, self._mode_of_region, self._rank)

    def _cluster(self, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Peak regions (m,) of the modes and the mode (K,) of each region, -1 for none."""
        r = self._regions
        return kernels.cluster_regions(
            mass, r.start, r.neighbours, self._centres, self._squared_radius, self._min_mass, _MOST_REGIONS, _MOST_MODES
        )

    def _sum(self, particles, weights, peaks, mode_of_region) -> tuple[Moments, np.ndarray]:
        reference = self._centres[peaks].astype(float)
        partial = np.zeros((CHUNKS, len(peaks), _SUMS))
        self._workers.run(
            len(particles),
            lambda low, high, chunk: kernels.sum_modes(
                low, high, particles.positions, particles.quaternions, particles.entries, weights,
                self._regions.of_entry, mode_of_region, reference, partial[chunk],
            ),
        )  # fmt: skip
        # the order of the regions' masses, rounding aside; sorted again so that it is exact
        order, *moments = kernels.mode_moments(partial, reference)
        return Moments(*moments), order


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
