"""What a step left out: work that a scene does not need, and input that cannot be used."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from .config import FilterConfig
from .motion_model import Odometry

GATES = (
    "at_rest",
    "no_contact",
    "unchanged_code",
    "effective_size",
    "whole_book",
    "unmoved_modes",
    "wide_modes",
    "unrivalled",
)
"""Each recognises work that can be skipped:

at_rest: the arm does not move; no_contact: nothing is felt; unchanged_code: the very same code again, a repeated image
and no new touch; effective_size: enough particles carry weight, resampling would only lose diversity; whole_book: few
particles, for which their own codebook entries are scored only; unmoved_modes: nothing happened to the particles;
wide_modes: no mode is narrow enough for its rendered view to tell anything; unrivalled: touches still fit what the
last re-evaluation said, so that the next can wait.
"""


class Gates:
    """Counts what was skipped, refused or added, by name.

    Args: open_gates, names of `GATES` that let everything pass, to see what they are worth.
    Attributes: counts, by name; note, the last refusal of this step in words, "" if there was none.
    """

    def __init__(self, open_gates: Collection[str] = ()):
        self.counts: dict[str, int] = dict.fromkeys(GATES, 0)
        self.note = ""
        self._open = frozenset(open_gates)

    def skips(self, gate: str, needless: bool) -> bool:
        """Count and return whether to skip work that is `needless`."""
        skip = bool(needless) and gate not in self._open
        self.counts[gate] += skip
        return skip

    def refuse(self, kind: str, reason: str) -> None:
        """Input was refused, for a reason in words."""
        self.count(kind, 1)
        self.note = reason

    def count(self, kind: str, number: int) -> None:
        """So many of a kind."""
        self.counts[kind] = self.counts.get(kind, 0) + number


class RestGate:
    """Holds back motion that is too small to matter; small steps add up, so that slow creeping is not lost.

    Args: config; gates, which counts what is held back as `at_rest`.
    """

    def __init__(self, config: FilterConfig, gates: Gates):
        self._config, self._gates = config, gates
        self.reset()

    def motion(self, odometry: Odometry) -> Odometry | None:
        """All motion since the last that was handed on, or None while it is too small."""
        total = odometry
        if self._pending is not None:
            total = Odometry.from_matrix(self._pending @ odometry.transform)
        moving = total.distance > self._config.update_min_d or total.angle > self._config.update_min_a
        held = self._gates.skips("at_rest", not moving)
        self._pending = total.transform if held else None
        return None if held else total

    def reset(self) -> None:
        """Forget small steps held back, because the particles were drawn anew."""
        self._pending: np.ndarray | None = None
