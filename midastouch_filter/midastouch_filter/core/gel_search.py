"""Where in the codebook a further finger's gel lies on every particle, from what was found for others before."""

from __future__ import annotations

import numpy as np

from midastouch_common import se3

from .lookup import PoseLookup
from .motion_model import Odometry
from .particles import Particles

_UNKNOWN, _NONE = -2, -1  # instead of an entry: not searched for yet; none about


class GelSearch:
    """Finds codebook entries of gels that hang on particles by a transform.

    Particles that share an entry have the finger nearly at the same position, also steps ago: the walk along the graph
    begins at the entry found for one of them, else for one of their neighbours. Only what is left is searched for.

    Args: lookup; reach [m], pose distance to the nearest entry beyond which there is none about.
    """

    def __init__(self, lookup: PoseLookup, reach: float):
        self._lookup, self._reach = lookup, reach
        self.restart()

    def restart(self) -> None:
        """Forget what was found."""
        self._found = np.full(len(self._lookup), _UNKNOWN, np.int32)  # by the particle's own entry
        self._found_at = np.zeros(len(self._lookup))
        self._drift = 0.0
        self._transform: np.ndarray | None = None

    def find(
        self, gels: Particles, near: np.ndarray, transform: np.ndarray
    ) -> tuple[np.ndarray, Particles, np.ndarray]:
        """Of the `gels` near the surface, (n,): those that have entries about, these with their entries, and distances.

        gels: with the entries of the particles that they hang on by `transform` (4, 4).
        """
        self._follow_drift(transform)
        start = self._starts(gels, near)
        near, start = near[start >= 0], start[start >= 0]
        close = Particles(gels.positions[near], gels.quaternions[near], gels.log_weights[near], start)
        distance = self._lookup.follow(close)
        self._remember(gels.entries[near], close.entries, distance < self._reach)
        return near, close, distance

    def _starts(self, gels: Particles, near: np.ndarray) -> np.ndarray:
        """An entry (n,) to walk on from for each of the gels `near` (n,); negative where there is none about."""
        entries = gels.entries[near]
        start = self._known(entries)
        off = np.flatnonzero(start < 0)
        around = self._known(self._lookup.neighbours[entries[off]])
        first = around[np.arange(len(off)), (around >= 0).argmax(axis=1)]
        start[off] = np.where(first >= 0, first, start[off])
        unknown = np.flatnonzero(start == _UNKNOWN)
        if len(unknown):
            rows = near[unknown]
            poses = se3.from_xyzquat(np.concatenate([gels.positions[rows], gels.quaternions[rows]], axis=1))
            found = self._lookup.exact(poses, within=self._reach)
            found[found == len(self._lookup)] = _NONE
            self._remember(entries[unknown], found, found == _NONE)
            start[unknown] = found
        return start

    def _remember(self, entries: np.ndarray, found: np.ndarray, right: np.ndarray) -> None:
        self._found[entries[right]] = found[right]
        self._found_at[entries[right]] = self._drift

    def _known(self, entries: np.ndarray) -> np.ndarray:
        """What was found last for these entries, unless that is too long ago to begin there."""
        fresh = self._drift - self._found_at[entries] < self._lookup.reach
        return np.where(fresh, self._found[entries], _UNKNOWN)

    def _follow_drift(self, transform: np.ndarray) -> None:
        """The fingers moved against each other: what was found for others is worth less and less."""
        if self._transform is not None:
            self._drift += Odometry.from_matrix(se3.inverse(self._transform) @ transform).path
        self._transform = transform
