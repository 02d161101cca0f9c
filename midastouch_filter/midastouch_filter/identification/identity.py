"""Identity of the touched object among those of a catalogue, with probabilities.

Identity and pose are estimated together: the filter's hypotheses are on all objects, and `unknown` competes with them.
All codes are of one network, so their fits are on one scale over all objects. docs/internals.md has the mathematics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.noise_model import NoiseModel
from ..filter import ParticleFilter

UNKNOWN = "unknown"
"""Name for an object that is none of the catalogue's."""

_NAMED_PROBABILITY = 0.01


@dataclass(frozen=True)
class PossiblePose:
    """One mode on an object, at present: pose (4, 4) `T_obj_gel`; covariance (6, 6) of [translation, rotation] in the
    pose's own frame, m and rad; probability."""

    pose: np.ndarray
    covariance: np.ndarray
    probability: float


@dataclass(frozen=True)
class CandidateObject:
    """An object of the catalogue: name; probability that it is touched; hypotheses on it, most probable first, whose
    probabilities add up to that; none before the object was compared with a touch."""

    name: str
    probability: float
    hypotheses: list[PossiblePose]


@dataclass(frozen=True)
class Identity:
    """Identity of the touched object: objects of the catalogue, most probable first; unknown, the probability that it
    is none of them. All probabilities together are 1."""

    objects: list[CandidateObject]
    unknown: float

    @classmethod
    def of(cls, names: Sequence[str], running: ParticleFilter) -> Identity:
        """Return the identity that a filter on several objects has found.

        Parameters
        ----------
        names
            Names of the objects, in the filter's order.
        running
            The filter.
        """
        probabilities, unknown = running.identity
        modes = _modes(running)
        objects = []
        for number, (name, probability) in enumerate(zip(names, probabilities.tolist(), strict=True)):
            own = [mode for on, mode in modes if on == number]
            factor = probability / max(sum(mode.probability for mode in own), 1e-300)
            scaled = [PossiblePose(mode.pose, mode.covariance, factor * mode.probability) for mode in own]
            objects.append(CandidateObject(name, probability, scaled))
        return cls(sorted(objects, key=lambda each: -each.probability), unknown)

    @property
    def leading(self) -> CandidateObject:
        """Most probable object."""
        return self.objects[0]

    @property
    def answer(self) -> str:
        """Name of the most probable object, or `UNKNOWN` if that is more probable."""
        return UNKNOWN if self.unknown > self.leading.probability else self.leading.name

    def in_words(self) -> str:
        """Return the competing objects as a phrase, such as "mug 62%, bowl 30%, unknown 8%"."""
        fractions = [*((each.name, each.probability) for each in self.objects), (UNKNOWN, self.unknown)]
        named = sorted((each for each in fractions if each[1] >= _NAMED_PROBABILITY), key=lambda each: -each[1])
        return ", ".join(f"{name} {fraction:.0%}" for name, fraction in named)


def _modes(running: ParticleFilter) -> list[tuple[int, PossiblePose]]:
    """Return the filter's modes on all objects at present, heaviest first, with the numbers of the objects."""
    groups = running.groups
    if not groups:
        return []
    first, jitter = [int(group.members[0]) for group in groups], NoiseModel.of(running.config).jitter
    now = running.belief.hypotheses.some(np.array(first)).widened(jitter).moved(running.belief.since)
    return [
        (group.object, PossiblePose(pose, covariance, group.weight))
        for group, pose, covariance in zip(groups, now.poses, now.covariances, strict=True)
    ]
