"""Which hypotheses are born: at the start, after a lift, and where touches contradict all that is believed.

A change is a birth of hypotheses and nothing else. The weight of those that are born is the probability of the change.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from midastouch_common import se3

from .belief import Belief, Hypotheses
from .noise_model import NoiseModel
from .pose_hypothesis import Prior

_LEADING = 4  # hypotheses whose neighbourhood is believed in after a push
_CROWDED = 2  # times the codebook: with as many untested poses no further ones are born


class Births:
    """Adds hypotheses to beliefs, modulo what is asked for.

    Args: noise; most: number of poses of each codebook, the first ones, which are spread evenly.
    """

    def __init__(self, noise: NoiseModel, most: int):
        self._noise, self._most = noise, most

    def anywhere(self, belief: Belief, log_mass: float, prior: Prior | None = None) -> None:
        """Add poses all over the objects, untested, `log_mass` in all; prior: of the pose, None if nothing is known.

        A prior that is narrower than entries are apart is a hypothesis of its own, with half of the mass.
        """
        of_each = log_mass - math.log(len(belief.objects))
        between = self._noise.between_entries
        sharp = prior is not None and bool((np.diag(prior.covariance) < np.diag(between)).all())
        of_each -= math.log(2) if sharp else 0.0
        for number, model in enumerate(belief.objects):
            entries = np.flatnonzero(model.order < self._most)
            log_weights = np.zeros(len(entries))
            if prior is not None:
                poses = model.lookup.poses[entries]
                log_weights = prior.widened(between).log_density(poses, self._noise.prior_floor, model.symmetry.exact)
            if sharp:
                own = Hypotheses.at(prior.pose[None], prior.covariance, np.array([of_each]), number, 0.0)
                belief.hypotheses = belief.hypotheses.joined(own)
            belief.expect(number, entries, log_weights - np.logaddexp.reduce(log_weights) + of_each)

    def of_finger(self, belief: Belief, gel: np.ndarray) -> None:
        """Take, in place of all untested poses with which the first finger's gel touches the object, those with which
        another gel (4, 4), in its frame, does.

        Of a finger on a corner, or in the air, none of the poses may be near the truth. Poses of which some are more
        probable stay: a prior is about the first finger.
        """
        if np.array_equal(gel, np.eye(4)):
            return
        for number, model in enumerate(belief.objects):
            if np.ptp(belief.untested[number].log_weights) > 0:
                continue
            some = belief.take(number, np.arange(len(belief.untested[number])))
            poses = model.lookup.poses[some.entries] @ se3.inverse(gel)
            belief.expect(number, model.lookup.exact(poses), some.log_weights, poses)

    def after_change(self, belief: Belief, probability: float) -> bool:
        """The object was moved with this probability, to anywhere; whether further poses were added."""
        untested = len(belief) - len(belief.hypotheses)
        if untested > _CROWDED * sum(min(len(model.lookup), self._most) for model in belief.objects):
            return False
        belief.scale(math.log1p(-probability) - belief.total())
        self.anywhere(belief, math.log(probability))
        return True

    def after_push(self, belief: Belief) -> None:
        """The object was pushed with the probability of that: to near where the leading hypotheses have it."""
        hypotheses = belief.hypotheses
        leading = np.argsort(-hypotheses.log_weights, kind="stable")[:_LEADING]
        pushed = hypotheses.some(leading).widened(self._noise.push)
        pushed = replace(pushed, log_weights=pushed.log_weights + math.log(self._noise.change_pushed))
        belief.hypotheses = hypotheses.joined(pushed)
