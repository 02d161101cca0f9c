"""What the belief takes for possible, as a few poses with probabilities: what the next touch is to decide between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import midastouch_kernels as kernels

from ..core.belief import Belief
from ..core.config import FilterConfig
from ..core.estimate import Mode
from ..core.object_model import ObjectModel
from ..core.pose_hypothesis import another
from ..refinement.refinement import is_narrow

MOST = 8
"""Hypotheses of one belief; the time of a suggestion grows with their square."""
_MOST_NARROW = MOST // 2  # the other half are for what is spread out


@dataclass(frozen=True)
class Hypothesis:
    """The sensor may touch the object of `model`, called `name`, at `pose` (4, 4) `T_obj_gel`.

    narrow: it stands for a narrow mode, or for what nearly has its surface; else it is one draw of many from what is
    spread out. residual_ratio: fraction of the last map that it left unexplained, None if it was not aligned to one.
    """

    model: ObjectModel
    pose: np.ndarray
    probability: float
    narrow: bool
    name: str = ""
    residual_ratio: float | None = None


def hypotheses_of(modes: Sequence[Mode], belief: Belief, model: ObjectModel, config: FilterConfig) -> list[Hypothesis]:
    """Hypotheses and draws, most probable first, probabilities of sum 1; modes, those that are published.

    A hypothesis is a narrow mode. The rest of the particles is represented by draws, unless that is less than the doubt
    that `converged_probability` leaves. A single hypothesis is then doubted that much: it is compared with poses that
    nearly have its surface, of which only a part tells; or with poses all over the object, if it has none of these.
    """
    chosen = [mode for mode in modes[:_MOST_NARROW] if is_narrow(mode, config)]
    taken = {k: mode for mode in chosen for k, own in enumerate(belief.answers) if own.pose is mode.pose}
    fits = {id(mode): belief.aligned[k].fit for k, mode in taken.items() if k in belief.aligned}
    narrow = [
        Hypothesis(
            model, mode.pose, mode.weight, True,
            residual_ratio=1.0 - fits[id(mode)] if id(mode) in fits else None,
        )
        for mode in chosen
    ]  # fmt: skip
    narrow = [*narrow[:1], *(_as_image(each, narrow[0].pose) for each in narrow[1:])]
    doubt, left = 1.0 - config.converged_probability, 1.0 - sum(each.probability for each in narrow)
    count, images = MOST - len(narrow), False
    if left <= doubt and len(narrow) > 1:
        poses, fraction = [], 0.0
    elif left <= doubt:
        images = bool(narrow) and len(model.symmetry.look_alikes) > 0
        poses = _look_alikes(model, narrow[0].pose, count) if images else _all_over(model, count)
        fraction = doubt
    else:
        poses, fraction = _spread(belief, list(taken), count), left
    draws = [Hypothesis(model, pose, fraction / len(poses), images) for pose in poses]
    total = fraction + sum(each.probability for each in narrow)
    return [replace(each, probability=each.probability / total) for each in [*narrow, *draws]]


def _as_image(hypothesis: Hypothesis, leading: np.ndarray) -> Hypothesis:
    """The hypothesis at an exact image of the leading pose (4, 4) if it is one of its look-alikes: how well either is
    known makes them differ everywhere, and only the surface where they really do is to be gone to."""
    symmetry = hypothesis.model.symmetry
    images = symmetry.look_alikes @ leading
    if not len(images):
        return hypothesis
    image = images[[symmetry.exact.distance(images, hypothesis.pose).argmin()]]
    if another(symmetry.exact)(image, hypothesis.pose)[0]:
        return hypothesis
    return replace(hypothesis, pose=symmetry.exact.nearest(image, hypothesis.pose)[0])


def _spread(belief: Belief, taken: list[int], count: int) -> np.ndarray:
    """Poses (count, 4, 4) drawn systematically by weight from the particles of none of the `taken` modes."""
    weights = np.where(np.isin(belief.members, taken), 0.0, belief.weights)
    return belief.particles.select(kernels.systematic(weights, count, 0.5)).poses


def _look_alikes(model: ObjectModel, pose: np.ndarray, count: int) -> np.ndarray:
    """At most `count` of the poses (C, 4, 4) that nearly have the same surface as this one (4, 4), evenly."""
    motions = model.symmetry.look_alikes
    if len(motions) > count:
        motions = motions[kernels.systematic(np.ones(len(motions)), count, 0.5)]
    return motions @ pose


def _all_over(model: ObjectModel, count: int) -> np.ndarray:
    """Poses (count, 4, 4) of the codebook, evenly."""
    poses = model.lookup.poses
    return poses[kernels.systematic(np.ones(len(poses)), count, 0.5)]
