"""Numbers that characterise the behaviour of code, with their tolerances on another machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_MARGIN = 4.0  # tolerance of a number over the largest change by nudges
_WILD = 4.0  # times a difference that does not matter: beyond, nudges lead elsewhere
_ELSEWHERE = 3.0  # times its tolerance by which a number may be off on a machine of another kind
_ODD = 0.02  # of a probe's numbers may be off further: a particle more or less was drawn there
_DIGITS = 6


@dataclass(frozen=True)
class Probe:
    """Probe of code. values: (T, K), K numbers at T moments; tolerance: (K,) or (T, K), by which they may differ."""

    values: np.ndarray
    tolerance: Sequence[float] | np.ndarray

    def steadied(self, nudged: Sequence[Probe]) -> Probe:
        """Return the moments before the first one at which nudged inputs lead elsewhere, with tolerances that include
        the effect of nudges until then; nudged: probes of such inputs."""
        off = np.max([np.abs(each.values - self.values) for each in nudged], axis=0)
        wild = np.flatnonzero((off > _WILD * np.asarray(self.tolerance)).any(axis=1))
        steady = slice(wild[0] if len(wild) else None)
        return Probe(self.values[steady], np.maximum(self.tolerance, _MARGIN * off)[steady])

    def agrees(self, other: Probe) -> bool:
        """Return whether the numbers of another probe agree with these, at the moments of this one."""
        theirs = other.values[: len(self.values)]
        same = theirs.shape == self.values.shape
        return same and bool(np.mean(np.abs(theirs - self.values) > _ELSEWHERE * np.asarray(self.tolerance)) <= _ODD)

    def to_json(self) -> dict:
        """Return the content that `from_json` reads."""
        parts = {"values": self.values, "tolerance": np.broadcast_to(self.tolerance, self.values.shape)}
        return {
            name: [[float(f"{x:.{digits}g}") for x in row] for row in np.asarray(part).tolist()]
            for (name, part), digits in zip(parts.items(), (_DIGITS, 2), strict=True)
        }

    @classmethod
    def from_json(cls, content: dict) -> Probe:
        """Return the probe whose content `to_json` returned."""
        return cls(np.array(content["values"], float), np.array(content["tolerance"], float))


Probes = dict[str, Probe]
