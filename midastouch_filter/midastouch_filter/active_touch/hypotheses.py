"""What the belief takes for possible, as a few poses with probabilities: what the next touch is to decide between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import midastouch_kernels as kernels

from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.object_model import ObjectModel
from ..refinement.refinement import is_narrow

MOST = 8
"""Hypotheses of one belief; the time of a suggestion grows with their square."""
_MOST_PLACES = 4


@dataclass(frozen=True)
class Hypothesis:
    """The sensor may touch the object of `model`, called `name`, at `pose` (4, 4) `T_obj_gel`.

    place: it stands for a narrow mode; else it is one draw of many from what is spread out. misfit: share of the last
    map that it left unexplained, None if it was not aligned to one.
    """

    model: ObjectModel
    pose: np.ndarray
    probability: float
    place: bool
    name: str = ""
    misfit: float | None = None


def hypotheses_of(belief: Belief, model: ObjectModel, config: FilterConfig) -> list[Hypothesis]:
    """Places and draws, most probable first, probabilities of sum 1.

    A place is a narrow mode. The rest of the particles is represented by draws, unless that is less than the doubt that
    `converged_probability` leaves. A single place is then doubted that much: it is compared with any other.
    """
    modes = [k for k, mode in enumerate(belief.answers[:_MOST_PLACES]) if is_narrow(belief.modes[k], config)]
    places = [
        Hypothesis(
            model, belief.answers[k].pose, belief.answers[k].weight, True,
            misfit=1.0 - belief.aligned[k].fit if k in belief.aligned else None,
        )
        for k in modes
    ]  # fmt: skip
    doubt, left = 1.0 - config.converged_probability, 1.0 - sum(place.probability for place in places)
    if left <= doubt and len(places) > 1:
        poses, share = [], 0.0
    elif left <= doubt:
        poses, share = _all_over(model, MOST - len(places)), doubt
    else:
        poses, share = _spread(belief, modes, MOST - len(places)), left
    draws = [Hypothesis(model, pose, share / len(poses), False) for pose in poses]
    total = share + sum(place.probability for place in places)
    return [replace(each, probability=each.probability / total) for each in [*places, *draws]]


def _spread(belief: Belief, taken: list[int], count: int) -> np.ndarray:
    """Poses (count, 4, 4) drawn systematically by weight from the particles of none of the `taken` modes."""
    weights = np.where(np.isin(belief.members, taken), 0.0, belief.weights)
    return belief.particles.select(kernels.systematic(weights, count, 0.5)).poses


def _all_over(model: ObjectModel, count: int) -> np.ndarray:
    """Poses (count, 4, 4) of the codebook, evenly."""
    poses = model.lookup.poses
    return poses[kernels.systematic(np.ones(len(poses)), count, 0.5)]
