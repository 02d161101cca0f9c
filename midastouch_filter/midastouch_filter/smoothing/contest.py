"""Whether touches are of one of these objects, or of none of them: what pose hypotheses on the objects tell of that.

Of a single object the comparison of its own hypotheses tells it, of a catalogue that of hypotheses on all of them.
docs/internals.md has the mathematics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.keyframes import WeighedWindow
from ..core.noise_model import NoiseModel
from ..core.pose_hypothesis import PoseHypothesis
from .window_likelihood import Followed, hypothesis_posterior

_ALIKE_PROBABILITY = 0.5  # probability that an object of no catalogue is like others of this one
_NEVER = 1e-300  # prior of none of the objects where that is not asked


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

    @classmethod
    def of(
        cls,
        owner: Sequence[int],
        hypotheses: list[PoseHypothesis],
        followed: Sequence[Followed],
        window: WeighedWindow,
    ) -> Contest:
        """From what became of each hypothesis over a window."""
        shape = len(followed), len(window.weights)
        return cls(
            np.array(owner, int),
            hypotheses,
            np.reshape([each.residual_ratio for each in followed], shape),
            np.reshape([each.squared_innovation() for each in followed], shape),
            window.weights,
            window.change,
        )

    def of_last(self, count: int) -> Contest:
        """What the last `count` touches alone say."""
        of_touches = ("residual_ratio", "squared_innovation", "weights", "change")
        return replace(self, **{name: getattr(self, name)[..., -count:] for name in of_touches})

    def posterior(
        self, noise: NoiseModel, objects: int, unknown: float, known: float | None = None
    ) -> tuple[np.ndarray, float]:
        """Probabilities (P,) of the hypotheses, and that of none of the objects, which is `unknown` beforehand.

        known: what earlier touches made of the latter for the first of these, where one object only is asked for.

        An object is as probable as its best hypothesis makes it: how many were followed says nothing of it. An object
        of no catalogue may be like none in this one, or like the others, those beside the most probable one.
        """
        followed = np.bincount(self.owner, minlength=objects)
        prior = (1 - unknown) / objects
        evidence = self.weights * noise.object_evidence(self.residual_ratio, self.squared_innovation, objects)
        # an object without a hypothesis is there, too
        nowhere = max(unknown + prior * (followed == 0).sum(), _NEVER)
        beforehand = np.append(prior / followed[self.owner], nowhere)
        at_first = beforehand
        if known is not None:
            at_first = np.append(beforehand[:-1] * (1 - known) / (1 - unknown), max(known, _NEVER))
        fractions, none = hypothesis_posterior(evidence, np.log(at_first), np.log(beforehand), self.change)
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
