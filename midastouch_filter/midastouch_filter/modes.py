"""Modes of the particle set: clustering in position and rotation (paper section 4.3, "hypothesis clustering").

The paper runs DBSCAN on positions, which needs every pair of particles that lie together: seconds at 10k converged
particles. Here the mass of each region of SE(3) is summed once, and peaks of the mass are found on the graph of
regions (ToMATo: Chazal, Guibas, Oudot and Skraba 2013), so that the cost beyond one pass over the particles depends
on the number of occupied regions only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from .lookup import PoseLookup, squared_distance
from .particles import Particles
from .regions import Regions
from .workers import CHUNKS, Workers

_VALLEY = 0.5  # two peaks stay two modes if the density between them falls below this share of the lower one
_MOST_MODES = 64  # reported; the mass of any further ones counts as "rest"

# while particles are spread all over, only the heaviest regions can belong to a mode worth reporting; the mass of the
# others counts as "rest"
_MOST_REGIONS = 4096

# sums per mode: weight, w*t (3), w*t*t' (6), w*q (4), w*q*q' (10), w*t*q' (12), number of particles
_SUMS = 37

_TRIANGLE = {n: np.triu_indices(n) for n in (3, 4)}


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
        self._squared_radius, self._min_mass = np.float32(radius**2), min_mass

    def find(self, particles: Particles, weights: np.ndarray) -> Moments:
        """Moments of the modes of particles with normalised weights (N,)."""
        mass = np.bincount(self._regions.of_entry[particles.entries], weights, minlength=len(self._regions))
        self._regions_of_peaks, self._mode_of_region = self._cluster(mass)
        return self.moments(particles, weights)

    def moments(self, particles: Particles, weights: np.ndarray) -> Moments:
        """Moments of the modes found last, for particles that were moved or weighed since."""
        moments, order = self._sum(particles, weights, self._regions_of_peaks, self._mode_of_region)
        self.peaks = self._regions_of_peaks[order].tolist()
        rank = np.full(len(order) + 1, -1, np.int32)
        rank[order] = np.arange(len(order), dtype=np.int32)
        self._rank_of_region = rank[self._mode_of_region]
        return moments

    def members(self, particles: Particles) -> np.ndarray:
        """Mode (N,) int32 of each particle, numbered as the latest moments, -1 for none."""
        return self._rank_of_region[self._regions.of_entry[particles.entries]]

    def _cluster(self, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Peak regions (m,) of the modes and the mode (K,) of each region, -1 for none."""
        r = self._regions
        occupied = np.flatnonzero(mass)
        if len(occupied) > _MOST_REGIONS:
            occupied = np.sort(occupied[np.argpartition(-mass[occupied], _MOST_REGIONS)[:_MOST_REGIONS]])
        density = _smooth(occupied, mass, r.start, r.neighbours)
        order = occupied[np.argsort(-density[occupied], kind="stable")]
        root = _climb(order, density, r.start, r.neighbours, self._centres, self._squared_radius)
        mass_of_root = np.bincount(root[occupied], mass[occupied], minlength=len(mass))
        peaks = np.flatnonzero(mass_of_root)
        peaks = peaks[np.argsort(-mass_of_root[peaks], kind="stable")][:_MOST_MODES]
        heavy = mass_of_root[peaks] >= self._min_mass
        heavy[0] = True
        peaks = peaks[heavy]
        mode_of_root = np.full(len(mass) + 1, -1, np.int32)
        mode_of_root[peaks] = np.arange(len(peaks), dtype=np.int32)
        return peaks, mode_of_root[root]

    def _sum(self, particles, weights, peaks, mode_of_region) -> tuple[Moments, np.ndarray]:
        reference = self._centres[peaks].astype(float)
        partial = np.zeros((CHUNKS, len(peaks), _SUMS))
        self._workers.run(
            len(particles),
            lambda low, high, chunk: _accumulate(
                low, high, particles.positions, particles.quaternions, particles.entries, weights,
                self._regions.of_entry, mode_of_region, reference, partial[chunk],
            ),
        )  # fmt: skip
        total = partial.sum(axis=0)
        # the order of the regions' masses, rounding aside; sorted again so that it is exact
        order = np.argsort(-total[:, 0], kind="stable")
        total, reference = total[order], reference[order]
        mean = total[:, 1:-1] / np.maximum(total[:, :1], np.finfo(float).tiny)
        moments = Moments(
            np.concatenate([reference[:, :3], reference[:, 4:]], axis=1),
            total[:, 0],
            total[:, -1].astype(int),
            mean[:, 0:3],
            _symmetric(mean[:, 3:9], 3),
            mean[:, 9:13],
            _symmetric(mean[:, 13:23], 4),
            mean[:, 23:35].reshape(-1, 3, 4),
        )
        return moments, order


def _symmetric(upper: np.ndarray, n: int) -> np.ndarray:
    """(m, n, n) symmetric matrices from rows of their upper triangles."""
    out = np.empty((len(upper), n, n))
    i, j = _TRIANGLE[n]
    out[:, i, j] = upper
    out[:, j, i] = upper
    return out


@numba.njit(cache=True, nogil=True)
def _smooth(occupied, mass, start, neighbours):
    """Mass of each occupied region plus half that of its neighbours: a density with less sampling noise."""
    density = np.zeros(mass.size)
    for r in occupied:
        around = 0.0
        for j in range(start[r], start[r + 1]):
            around += mass[neighbours[j]]
        density[r] = mass[r] + 0.5 * around
    return density


@numba.njit(cache=True, nogil=True)
def _climb(order, density, start, neighbours, centres, squared_radius):
    """Root (K,) of each region in `order` (by falling density); the number of regions, K, for all others."""
    count = density.size
    root = np.full(count, count, np.int64)
    for r in order:
        best = -1
        for j in range(start[r], start[r + 1]):
            other = neighbours[j]
            if root[other] < count and (best < 0 or density[other] > density[best]):
                best = other
        if best < 0:
            root[r] = r
            continue
        own = _find(root, best)
        root[r] = own
        for j in range(start[r], start[r + 1]):
            if root[neighbours[j]] == count:
                continue
            rival = _find(root, neighbours[j])
            if rival == own:
                continue
            lower, higher = (rival, own) if density[rival] < density[own] else (own, rival)
            a, b = centres[lower], centres[higher]
            near = squared_distance(a[0], a[1], a[2], a[4], a[5], a[6], a[7], b) <= squared_radius
            if near and density[r] >= _VALLEY * density[lower]:
                root[lower] = higher
                own = higher if own == lower else own
    for r in order:
        root[r] = _find(root, r)
    return root


@numba.njit(cache=True, inline="always")
def _find(root, r):
    while root[r] != r:
        root[r] = root[root[r]]
        r = root[r]
    return r


@numba.njit(cache=True, nogil=True)
def _accumulate(low, high, positions, quaternions, entries, weights, of_entry, mode_of_region, reference, out):
    t, q = np.empty(3), np.empty(4)
    for i in range(low, high):
        mode = mode_of_region[of_entry[entries[i]]]
        w = weights[i]
        if mode < 0:
            continue
        sums, origin = out[mode], reference[mode]
        dot = 0.0
        for a in range(3):
            t[a] = positions[i, a] - origin[a]
        for a in range(4):
            q[a] = quaternions[i, a]
            dot += q[a] * origin[4 + a]
        if dot < 0:
            for a in range(4):
                q[a] = -q[a]
        sums[0] += w
        k = 1
        for a in range(3):
            sums[k] += w * t[a]
            k += 1
        for a in range(3):
            for b in range(a, 3):
                sums[k] += w * t[a] * t[b]
                k += 1
        for a in range(4):
            sums[k] += w * q[a]
            k += 1
        for a in range(4):
            for b in range(a, 4):
                sums[k] += w * q[a] * q[b]
                k += 1
        for a in range(3):
            for b in range(4):
                sums[k] += w * t[a] * q[b]
                k += 1
        sums[k] += 1.0
