"""Modes of the particle set: clustering in position and rotation (paper section 4.3, "hypothesis clustering").

The paper runs DBSCAN on positions, which needs every pair of particles that lie together: seconds at 10k converged
particles. Here the mass of each region of SE(3) is summed once, and peaks of the mass are found on the graph of
regions (ToMATo: Chazal, Guibas, Oudot and Skraba 2013), so that the cost beyond one pass over the particles depends
on the number of occupied regions only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels

from .lookup import PoseLookup
from .particles import Particles
from .regions import Regions
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
    mass (m,); count (m,) particles; position (m, 3) and position_square (m, 3, 3), relative to the reference [m];
    quaternion (m, 4); quaternion_square (m, 4, 4); cross (m, 3, 4). All but mass and count are means.
    """

    reference: np.ndarray
    mass: np.ndarray
    count: np.ndarray
    position: np.ndarray
    position_square: np.ndarray
    quaternion: np.ndarray
    quaternion_square: np.ndarray
    cross: np.ndarray


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
        """Moments of the modes found last, for particles that were moved or weighed since."""
        moments, order = self._sum(particles, weights, self._regions_of_peaks, self._mode_of_region)
        self.peaks = self._regions_of_peaks[order].tolist()
        self._rank = np.full(len(order) + 1, -1, np.int32)  # the last stands for -1: no mode
        self._rank[order] = np.arange(len(order), dtype=np.int32)
        return moments

    def members(self, particles: Particles) -> np.ndarray:
        """Mode (N,) int32 of each particle, numbered as the latest moments, -1 for none."""
        return self._rank[self._mode_of_region[self._regions.of_entry[particles.entries]]]

    def _cluster(self, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Peak regions (m,) of the modes and the mode (K,) of each region, -1 for none."""
        r = self._regions
        occupied = np.flatnonzero(mass > 0)  # of Booleans, which takes a fraction of the time
        if len(occupied) > _MOST_REGIONS:
            occupied = np.sort(occupied[np.argpartition(-mass[occupied], _MOST_REGIONS)[:_MOST_REGIONS]])
        density = kernels.smooth_regions(occupied, mass, r.start, r.neighbours)
        order = occupied[np.argsort(-density[occupied], kind="stable")]
        root = kernels.climb_regions(order, density, r.start, r.neighbours, self._centres, self._squared_radius)
        root = root[occupied]
        mass_of_root = np.bincount(root, mass[occupied], minlength=len(mass))
        peaks = occupied[mass_of_root[occupied] > 0]
        peaks = peaks[np.argsort(-mass_of_root[peaks], kind="stable")][:_MOST_MODES]
        heavy = mass_of_root[peaks] >= self._min_mass
        heavy[0] = True
        peaks = peaks[heavy]
        mode_of_root = np.full(len(mass), -1, np.int32)
        mode_of_root[peaks] = np.arange(len(peaks), dtype=np.int32)
        mode_of_region = np.full(len(mass), -1, np.int32)
        mode_of_region[occupied] = mode_of_root[root]
        return peaks, mode_of_region

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
        total = partial.sum(axis=0)
        # the order of the regions' masses, rounding aside; sorted again so that it is exact
        order = np.argsort(-total[:, 0], kind="stable")
        total, reference = total[order], reference[order]
        square = total[:, :-1].reshape(-1, 8, 8)
        mass = square[:, 0, 0].copy()
        square /= np.maximum(mass, np.finfo(float).tiny)[:, None, None]
        parts = square[:, 0, 1:4], square[:, 1:4, 1:4], square[:, 0, 4:], square[:, 4:, 4:], square[:, 1:4, 4:]
        reference = np.concatenate([reference[:, :3], reference[:, 4:]], axis=1)
        moments = Moments(reference, mass, total[:, -1].astype(int), *map(np.ascontiguousarray, parts))
        return moments, order
