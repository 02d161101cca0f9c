"""When particles are resampled, and to how many (paper section 4.3; KLD sampling, appendix C)."""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels

from . import kld
from .belief import Belief
from .config import FilterConfig
from .gates import Gates
from .regions import Regions
from .resampling import effective_size, systematic

_SURPLUS = 2  # times the wanted particles, from which even weights are resampled, to save time


class Resampler:
    """Systematic resampling, when it is worth it, to as many particles as KLD sampling asks for."""

    def __init__(self, regions: Regions, config: FilterConfig, rng: np.random.Generator, gates: Gates):
        self._regions, self._config, self._rng, self._gates = regions, config, rng, gates

    def __call__(self, belief: Belief, needed: bool = False) -> None:
        """Resample if the weights are uneven, if there are far more particles than wanted, or if it is `needed`."""
        particles, n = belief.particles, len(belief.particles)
        if not needed and n <= _SURPLUS * self._wanted(particles.entries):
            enough = effective_size(belief.weights) >= self._config.resample_ess * n
            if self._gates.skips("effective_size", enough):
                return
        ancestors = systematic(belief.weights, n, self._rng)
        wanted = self._wanted(particles.entries[ancestors])
        if wanted != n:
            ancestors = systematic(belief.weights, wanted, self._rng)
        belief.hold(particles.select(ancestors))

    def _wanted(self, entries: np.ndarray) -> int:
        """Number of particles that a distribution over the codebook like `entries` (n,) needs."""
        if not self._config.kld_sampling:
            return self._config.max_particles
        occupied = kernels.occupied_regions(self._regions.of_entry, entries, len(self._regions))
        return kld.adapted_count(occupied, self._config)
