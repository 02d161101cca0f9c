"""Births of hypotheses: at the start, after a lift, and when touches contradict the whole belief.

A change is modelled as a birth of hypotheses only. The weight of the newborn is the probability of the change.
"""

from __future__ import annotations

import math

import numpy as np

from midastouch_common import se3

from .belief import Belief, Hypotheses
from .noise_model import NoiseModel
from .pose_difference import Prior

_CROWDED = 2  # with more untested poses than this many codebooks hold, no further ones are born


class Births:
    """Source of new hypotheses and untested poses for a belief.

    Args: noise; most: number of poses of each codebook that are used: the first ones, which are spread evenly.
    """

    def __init__(self, noise: NoiseModel, most: int):
        self._noise, self._most = noise, most

    def anywhere(self, belief: Belief, log_mass: float, prior: Prior | None = None) -> None:
        """Add untested poses all over the objects, of `log_mass` in all; prior: of the pose, None if nothing is known.

        A prior that is narrower than the distance between entries is also a hypothesis, with half of the mass.
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
        """Replace untested poses, at which the first finger's gel touches the object, by those at which another does.

        gel (4, 4): pose of the other gel in the first one's frame. If the first finger is on a corner or in the air,
        none of the poses at which it touches may be near the truth. Poses of unequal weight stay: they come from a
        prior, which is about the first finger.
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
        """Allow for a move of the object to anywhere, of this probability; return whether poses were added."""
        untested = len(belief) - len(belief.hypotheses)
        if untested > _CROWDED * sum(min(len(model.lookup), self._most) for model in belief.objects):
            return False
        belief.scale(math.log1p(-probability) - belief.total())
        self.anywhere(belief, math.log(probability))
        return True
