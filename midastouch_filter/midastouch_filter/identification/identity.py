"""Which object of a catalogue is touched, and how probable that is.

Identity and pose are one question: the posterior is over hypotheses on all objects, from the same keyframes, and
`unknown` is what none of them explains. Codes are of one network, so that how well they fit is on one scale over all
objects. docs/internals.md has the mathematics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.noise_model import NoiseModel
from ..core.pose_hypothesis import PoseHypothesis
from ..smoothing.window_likelihood import hypothesis_posterior

UNKNOWN = "unknown"
"""Name of what is none of the catalogue's objects."""

_NAMED_PROBABILITY = 0.01
_ALIKE_PROBABILITY = 0.5  # probability that an object of no catalogue is like others of this one


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


@dataclass(frozen=True)
class Contest:
    """What the last touches say of P hypotheses on several objects.

    owner (P,), number of the object; hypotheses, at present, of no probability yet; residual_ratio (P, K), fraction of
    each of K maps that a hypothesis leaves unexplained; squared_innovation (P, K), squared Mahalanobis distance that it
    has to give way to fit; weights (K,) and change (K,), as of `WeighedWindow`.
    """

    owner: np.ndarray
    hypotheses: list[PoseHypothesis]
    residual_ratio: np.ndarray
    squared_innovation: np.ndarray
    weights: np.ndarray
    change: np.ndarray

    def posterior(self, noise: NoiseModel, objects: int, unknown: float) -> tuple[np.ndarray, float]:
        """Probabilities (P,) of the hypotheses, and that of none of the objects, which is `unknown` beforehand.

        An object is as probable as its best hypothesis makes it: how many were followed says nothing of it. An object
        of no catalogue may be like none in this one, or like the others, those beside the most probable one.
        """
        followed = np.bincount(self.owner, minlength=objects)
        prior = (1 - unknown) / objects
        evidence = self.weights * noise.object_evidence(self.residual_ratio, self.squared_innovation)
        nowhere = unknown + prior * (followed == 0).sum()  # an object without a hypothesis is there, too
        beforehand = np.log(np.append(prior / followed[self.owner], nowhere))
        fractions, none = hypothesis_posterior(evidence, beforehand, beforehand, self.change)
        best = np.zeros(objects)
        np.maximum.at(best, self.owner, fractions)
        of_object, summed = best * followed, np.bincount(self.owner, fractions, objects)
        fractions *= (of_object / np.maximum(summed, np.finfo(float).tiny))[self.owner]
        if objects > 1:
            fits_none = none / nowhere
            fits = np.where(followed > 0, of_object / prior, fits_none)
            alike = (fits.sum() - fits.max()) / (objects - 1)
            none += _ALIKE_PROBABILITY * unknown * (alike - fits_none)
        total = fractions.sum() + none
        return fractions / total, float(none / total)
