"""Numbers that tell what code does, and how far they may be off on another machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_MARGIN = 4.0  # times as far as nudges have moved a number it may be off
_WILD = 4.0  # times what matters to nobody, from which nudges lead elsewhere
_ELSEWHERE = 3.0  # times its tolerance by which a number may be off on a machine of another kind
_ODD = 0.02  # of a probe's numbers may be off further: a particle more or less was drawn there
_DIGITS = 6


@dataclass(frozen=True)
class Probe:
    """values (T, K): K numbers at T moments; tolerance (K,) or (T, K), by how much they may differ."""

    values: np.ndarray
    tolerance: Sequence[float] | np.ndarray

    def steadied(self, nudged: Sequence[Probe]) -> Probe:
        """The moments before the first one at which slightly other inputs lead elsewhere, with a tolerance that holds
        what they do until then; nudged: the same of such inputs."""
        off = np.max([np.abs(each.values - self.values) for each in nudged], axis=0)
        wild = np.flatnonzero((off > _WILD * np.asarray(self.tolerance)).any(axis=1))
        steady = slice(wild[0] if len(wild) else None)
        return Probe(self.values[steady], np.maximum(self.tolerance, _MARGIN * off)[steady])

    def agrees(self, other: Probe) -> bool:
        """Whether the other one tells the same, at the moments of this one."""
        theirs = other.values[: len(self.values)]
        same = theirs.shape == self.values.shape
        return same and bool(np.mean(np.abs(theirs - self.values) > _ELSEWHERE * np.asarray(self.tolerance)) <= _ODD)

    def to_json(self) -> dict:
        """What `from_json` reads."""
        parts = {"values": self.values, "tolerance": np.broadcast_to(self.tolerance, self.values.shape)}
        return {
            name: [[float(f"{x:.{digits}g}") for x in row] for row in np.asarray(part).tolist()]
            for (name, part), digits in zip(parts.items(), (_DIGITS, 2), strict=True)
        }

    @classmethod
    def from_json(cls, content: dict) -> Probe:
        """What `to_json` gave."""
        return cls(np.array(content["values"], float), np.array(content["tolerance"], float))


Probes = dict[str, Probe]
