"""The modes that are published: the hypotheses of the last comparison, each where the particles that follow it are.

Particles follow a hypothesis from touch to touch, but do not keep all of them: one that some codes speak against loses
its particles, and two that are near each other become one mode. The comparison has weighed all of them by the last
maps, so its probabilities are the weights, and a hypothesis without particles goes on by the odometry alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from midastouch_common import se3

from ..core.belief import Belief, covariance_about
from ..core.config import FilterConfig
from ..core.estimate import Mode
from ..core.pose_hypothesis import PoseHypothesis, another, far_from
from ..refinement.fine_stage import Published
from ..refinement.refinement import is_narrow
from .reevaluation import Comparison

_NOTHING = 1e-3  # probability that is left to no mode


def published_modes(
    comparison: Comparison, onward: np.ndarray, still: float, belief: Belief, config: FilterConfig
) -> Published:
    """The modes of a comparison, heaviest first.

    onward (4, 4): motion of the gel since the comparison; still: probability that the object was not moved meanwhile.
    What is left goes to the particles that lie elsewhere.
    """
    named = [each.moved(onward) for each in comparison.hypotheses if each.probability >= config.min_mode_mass]
    if named:  # as the belief has it: near its heaviest mode
        poses = comparison.symmetry.nearest(np.stack([each.pose for each in named]), belief.modes[0].pose)
        named = [replace(each, pose=pose) for each, pose in zip(named, poses, strict=True)]
    weights = still * np.array([each.probability for each in named])
    owners = list(owners_of(named, belief.modes, comparison, config))
    modes = [
        _without_particles(hypothesis, weight) if k is None else replace(belief.answers[k], weight=float(weight))
        for hypothesis, weight, k in zip(named, weights, owners, strict=True)
    ]
    listed = float(weights.sum())
    at = np.stack([mode.pose for mode in belief.modes])
    apart = far_from([each.pose for each in named], at, another(comparison.symmetry))
    others = [k for k in np.flatnonzero(apart) if k not in owners]
    taken = sum(belief.modes[k].weight for k in owners if k is not None)
    for k in others:
        weight = (1.0 - listed) * belief.modes[k].weight / max(1.0 - taken, belief.modes[k].weight)
        if weight >= config.min_mode_mass or not modes:
            modes.append(replace(belief.answers[k], weight=weight))
    modes.sort(key=lambda mode: -mode.weight)
    return Published(modes, listed, _covariance(modes, belief))


def _covariance(modes: list[Mode], belief: Belief) -> np.ndarray:
    """Of the whole belief about the pose of the first mode: of the modes and, in so far as their weights leave
    something, of all particles."""
    first, poses = modes[0], np.stack([mode.pose for mode in modes])
    turned = se3.log(se3.make(poses[:, :3, :3] @ first.pose[:3, :3].T, np.zeros((len(modes), 3))))[:, 3:]
    offset = np.hstack([poses[:, :3, 3] - first.pose[:3, 3], turned])
    weights = np.array([mode.weight for mode in modes])
    named = weights.sum()
    within = np.stack([mode.covariance for mode in modes])
    covariance = np.einsum("m,mij->ij", weights, within) + (weights * offset.T) @ offset
    if named > 1.0 - _NOTHING:
        return covariance / named
    # mode 0 are the first one's own particles, if it has any
    others = belief.members if first.pose is belief.answers[0].pose else np.ones_like(belief.members)
    return covariance + (1.0 - named) * covariance_about(first, others, belief.particles, belief.weights)


def owners_of(
    hypotheses: list[PoseHypothesis], modes: list[Mode], comparison: Comparison, config: FilterConfig
) -> Iterator[int | None]:
    """The number of the heaviest narrow mode at each hypothesis, None if none is nearest to it.

    Clustering splits a mode in two at times; both parts are at one hypothesis.
    """
    if not hypotheses or not modes:
        return
    at = np.stack([each.pose for each in hypotheses])
    distance = np.stack([comparison.symmetry.distance(at, mode.pose) for mode in modes], axis=1)
    narrow = np.array([is_narrow(mode, config) for mode in modes]) & (distance.min(axis=0) < config.converged_error)
    nearest = np.where(narrow, distance.argmin(axis=0), -1)
    for i in range(len(hypotheses)):
        yield next((int(k) for k in np.flatnonzero(nearest == i)), None)


def _without_particles(hypothesis: PoseHypothesis, weight: float) -> Mode:
    turn = se3.turn(hypothesis.pose[:3, :3])
    return Mode(float(weight), hypothesis.pose, turn @ hypothesis.covariance @ turn.T, 0)
