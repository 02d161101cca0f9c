"""Which object of a catalogue is touched, and how probable that is.

Identity and pose are one question: the posterior is over hypotheses on all objects, from the same keyframes, and
`unknown` is what none of them explains. Codes are of one network, so that how well they fit is on one scale over all
objects. docs/internals.md has the mathematics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.pose_hypothesis import PoseHypothesis

UNKNOWN = "unknown"
"""Name of what is none of the catalogue's objects."""

_NAMED_PROBABILITY = 0.01


@dataclass(frozen=True)
class CandidateObject:
    """An object of the catalogue: name; probability that it is touched; hypotheses on it, most probable first, whose
    probabilities sum up to that."""

    name: str
    probability: float
    hypotheses: list[PoseHypothesis]


@dataclass(frozen=True)
class Identity:
    """What is touched: objects of the catalogue, most probable first; unknown, the probability that it is none of
    them. All probabilities together are 1."""

    objects: list[CandidateObject]
    unknown: float

    @property
    def leading(self) -> CandidateObject:
        """The most probable object."""
        return self.objects[0]

    @property
    def answer(self) -> str:
        """The most probable object's name, or `UNKNOWN` if that is more probable."""
        return UNKNOWN if self.unknown > self.leading.probability else self.leading.name

    def moved(self, transform: np.ndarray) -> Identity:
        """After the gel moved by `transform` (4, 4)."""
        moved = [replace(one, hypotheses=[each.moved(transform) for each in one.hypotheses]) for one in self.objects]
        return replace(self, objects=moved)

    def in_words(self) -> str:
        """Those that compete, such as "mug 62 %, bowl 30 %, unknown 8 %"."""
        fractions = [*((each.name, each.probability) for each in self.objects), (UNKNOWN, self.unknown)]
        named = sorted((each for each in fractions if each[1] >= _NAMED_PROBABILITY), key=lambda each: -each[1])
        return ", ".join(f"{name} {fraction:.0%}" for name, fraction in named)
