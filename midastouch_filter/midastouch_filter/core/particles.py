"""The particle set: sensor poses on the object with log-weights (paper section 4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from midastouch_common import se3


@dataclass
class Particles:
    """N weighted hypotheses `T_obj_gel`.

    positions (N, 3) float32 m; quaternions (N, 4) float32 xyzw, unit; log_weights (N,) float64, normalised so that
    the weights sum to 1, except in a `Belief`; entries (N,) int32, the codebook entry nearest to each particle.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    log_weights: np.ndarray
    entries: np.ndarray

    @classmethod
    def from_poses(cls, poses: np.ndarray, entries: np.ndarray) -> Particles:
        """Return equally weighted particles at poses `T_obj_gel` (N, 4, 4) with their codebook entries (N,)."""
        rows = se3.to_xyzquat(poses)
        return cls(
            np.ascontiguousarray(rows[:, :3], np.float32),
            np.ascontiguousarray(rows[:, 3:], np.float32),
            np.full(len(rows), -np.log(max(len(rows), 1))),
            np.ascontiguousarray(entries, np.int32),
        )

    @classmethod
    def joined(cls, sets: list[Particles]) -> Particles:
        """Return all particles of several sets, with their weights."""
        names = ("positions", "quaternions", "log_weights", "entries")
        return cls(*(np.concatenate([getattr(each, name) for each in sets]) for name in names))

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def poses(self) -> np.ndarray:
        """Poses `T_obj_gel` (N, 4, 4) float64."""
        return se3.from_xyzquat(np.concatenate([self.positions, self.quaternions], axis=1))

    @property
    def weights(self) -> np.ndarray:
        """Weights (N,) float64, exp(log_weights)."""
        return np.exp(self.log_weights)

    def some(self, rows: np.ndarray) -> Particles:
        """Return the particles of an index or mask, with their weights."""
        return Particles(*(np.ascontiguousarray(each[rows]) for each in vars(self).values()))

    def select(self, ancestors: np.ndarray) -> Particles:
        """Return equally weighted copies of the particles at indices `ancestors` (n,)."""
        return Particles(
            self.positions.take(ancestors, axis=0),
            self.quaternions.take(ancestors, axis=0),
            np.full(len(ancestors), -np.log(len(ancestors))),
            self.entries.take(ancestors),
        )
