"""Reduction of the belief to a few poses with probabilities, between which the next touch should decide."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import midastouch_kernels as kernels

from ..core.answer import Group, modes_of
from ..core.belief import Belief
from ..core.noise_model import REGION_WIDTH, NoiseModel
from ..core.object_model import ObjectModel
from ..core.pose_difference import another
from ..filter import ParticleFilter

MOST = 8
"""Hypotheses of one belief; the time of a suggestion grows with their square."""
_MOST_NARROW = MOST // 2  # the other half is for the rest of the belief, which is spread out
_NARROW, _NARROW_TURN = 8e-3, np.radians(24.0)  # m, rad: RMS spread of a mode below which one pose stands for it


@dataclass(frozen=True)
class Hypothesis:
    """Possible pose (4, 4) `T_obj_gel` of the sensor on the object of `model`, called `name`.

    narrow: it stands for a narrow mode, or for a look-alike of one; otherwise it is one of many draws from the rest
    of the belief. residual_ratio: fraction of the last map that it left unexplained, None if it was not aligned to one.
    """

    model: ObjectModel
    pose: np.ndarray
    probability: float
    narrow: bool
    name: str = ""
    residual_ratio: float | None = None


def hypotheses_of(running: ParticleFilter) -> list[Hypothesis]:
    """Return hypotheses and draws of a filter that was started, most probable first, with probabilities of sum 1.

    A hypothesis is a narrow mode. Draws represent the rest of the belief, unless that is less than the doubt
    that `converged_probability` leaves. A single hypothesis is then doubted that much: its competitors are its
    look-alikes, whose surface differs in a part only, or poses all over the object if it has no look-alikes.
    """
    belief, weights = running.belief, _probabilities(running.belief)
    groups = [(sum(weights[group.members]), group) for group in running.groups]
    groups = sorted(groups, key=lambda each: -each[0])[:_MOST_NARROW]
    modes = modes_of(belief, [group for _, group in groups], {}, REGION_WIDTH, NoiseModel.of(running.config))
    narrow, taken = [], []
    for (probability, group), mode in zip(groups, modes, strict=True):
        if mode.spread_translation < _NARROW and mode.spread_rotation < _NARROW_TURN:
            model, residual = belief.objects[group.object], 1.0 - float(belief.hypotheses.fit[group.members[0]])
            narrow.append(Hypothesis(model, mode.pose, probability, True, _name(belief, group.object), residual))
            taken.append(group)
    narrow = [*narrow[:1], *(_as_image(each, narrow[0]) for each in narrow[1:])]
    doubt, left = 1.0 - running.config.converged_probability, 1.0 - sum(each.probability for each in narrow)
    count = MOST - len(narrow)
    if left > doubt:
        draws = _spread(belief, weights, taken, count)
    elif len(narrow) > 1:
        draws, left = [], 0.0
    else:
        (found,), left = narrow, doubt
        images = len(found.model.symmetry.look_alikes) > 0
        poses = _look_alikes(found.model, found.pose, count) if images else _all_over(found.model, count)
        draws = [Hypothesis(found.model, pose, 0.0, images, found.name) for pose in poses]
    draws = [replace(each, probability=left / len(draws)) for each in draws]
    total = left + sum(each.probability for each in narrow)
    return [replace(each, probability=each.probability / total) for each in [*narrow, *draws]]


def _probabilities(belief: Belief) -> np.ndarray:
    """Return probabilities (P,) of all hypotheses, then of all untested poses; once an object has a hypothesis, poses
    on objects without one have none."""
    log_weights = [belief.hypotheses.log_weights, *(some.log_weights for some in belief.untested)]
    weights = np.exp(np.concatenate(log_weights) - belief.total())
    known = np.isin(_objects(belief), belief.hypotheses.objects)
    if known.any():
        weights = np.where(known, weights, 0.0)
    return weights / weights.sum()


def _objects(belief: Belief) -> np.ndarray:
    """Return the numbers (P,) of the objects that all hypotheses, then all untested poses, are on."""
    return np.concatenate(
        [belief.hypotheses.objects, *(np.full(len(some), k) for k, some in enumerate(belief.untested))]
    )


def _name(belief: Belief, number: int) -> str:
    """Return the name of an object of several; "" if there is only one."""
    return belief.objects[number].mesh.name if len(belief.objects) > 1 else ""


def _as_image(hypothesis: Hypothesis, leading: Hypothesis) -> Hypothesis:
    """Move a hypothesis that is a look-alike of the leading one to its exact image: otherwise the errors of both would
    make them differ everywhere, and touches should go only where the surfaces really differ."""
    symmetry = hypothesis.model.symmetry
    images = symmetry.look_alikes @ leading.pose
    if hypothesis.model is not leading.model or not len(images):
        return hypothesis
    image = images[[symmetry.exact.distance(images, hypothesis.pose).argmin()]]
    if another(symmetry.exact)(image, hypothesis.pose)[0]:
        return hypothesis
    return replace(hypothesis, pose=symmetry.exact.nearest(image, hypothesis.pose)[0])


def _spread(belief: Belief, weights: np.ndarray, taken: list[Group], count: int) -> list[Hypothesis]:
    """Draw systematically, by weights (P,), from everything that is in none of the `taken` groups."""
    weights, known = weights.copy(), belief.hypotheses.poses
    for group in taken:
        weights[group.members] = 0.0
    chosen, objects = kernels.systematic(weights, count, 0.5), _objects(belief)
    starts = np.cumsum([len(known), *map(len, belief.untested)])
    poses = [known[chosen[chosen < len(known)]]]
    for low, high, some in zip(starts, starts[1:], belief.untested, strict=False):
        poses.append(some.some(chosen[(chosen >= low) & (chosen < high)] - low).poses)
    return [
        Hypothesis(belief.objects[number], pose, 0.0, False, _name(belief, number))
        for number, pose in zip(objects[chosen], np.concatenate(poses) @ belief.since, strict=True)
    ]


def _look_alikes(model: ObjectModel, pose: np.ndarray, count: int) -> np.ndarray:
    """Return at most `count` evenly chosen poses (C, 4, 4) that nearly have the same surface as this one (4, 4)."""
    motions = model.symmetry.look_alikes
    if len(motions) > count:
        motions = motions[kernels.systematic(np.ones(len(motions)), count, 0.5)]
    return motions @ pose


def _all_over(model: ObjectModel, count: int) -> np.ndarray:
    """Return evenly chosen poses (count, 4, 4) of the codebook."""
    poses = model.lookup.poses
    return poses[kernels.systematic(np.ones(len(poses)), count, 0.5)]
