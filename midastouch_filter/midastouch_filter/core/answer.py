"""Answer of a belief: modes with weight and covariance, covariance of the whole, and draws of the pose.

Hypotheses that count as one pose, modulo symmetry, are one mode; its weight is the sum of theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3

from .alignment import Sighting, transform_covariance
from .belief import Belief
from .estimate import Mode
from .noise_model import NoiseModel
from .pose_difference import alike, another

_MOST_MODES, _GROUPED = 64, 200  # modes that are published; heaviest hypotheses that are grouped into modes
_NEGLIGIBLE = 1e-5  # probability below which a hypothesis makes no mode of its own
_HARDLY_ANY = 1e-14  # m^2, rad^2: added to a covariance that rounding may have made singular


@dataclass(frozen=True)
class Group:
    """One mode: weight; members (n,), numbers of its hypotheses, heaviest first; object, its number."""

    weight: float
    members: np.ndarray
    object: int


def grouped(belief: Belief) -> list[Group]:
    """Return the modes of a belief, heaviest first; none while no hypothesis was tested."""
    hypotheses = belief.hypotheses
    if not len(hypotheses):
        return []
    probability = np.exp(hypotheses.log_weights - belief.total())
    order = np.argsort(-probability, kind="stable")[:_GROUPED]
    order = order[probability[order] >= min(_NEGLIGIBLE, probability[order[0]])]
    groups: list[Group] = []
    for number in np.unique(hypotheses.objects[order]):
        own = order[hypotheses.objects[order] == number]
        symmetry = belief.objects[number].symmetry.exact
        differ = another(symmetry)
        near = alike(hypotheses.poses[own]) if symmetry.trivial else None
        left = np.arange(len(own))
        while len(left):
            poses, first = hypotheses.poses[own[left]], left[0]
            same = near[first, left] if near is not None else ~differ(poses, poses[0])
            members, left = own[left[same]], left[~same]
            groups.append(Group(float(probability[members].sum()), members, int(number)))
    return sorted(groups, key=lambda group: -group.weight)[:_MOST_MODES]


def modes_of(
    belief: Belief, groups: Sequence[Group], sightings: dict[int, Sighting], widening: float, noise: NoiseModel
) -> list[Mode]:
    """Return groups as modes at present, each at its heaviest hypothesis, or where this frame's maps see that.

    sightings: by number of the hypothesis. widening: factor on the covariance of a sighting.
    """
    hypotheses, total = belief.hypotheses, belief.total()
    out = []
    for group in groups:
        first = int(group.members[0])
        sighting = sightings.get(first)
        if sighting is None:
            pose = hypotheses.poses[first] @ belief.since
            own = transform_covariance(hypotheses.covariances[first] + noise.jitter, belief.since)
        else:
            pose, own = sighting.pose, widening * (1.0 - sighting.fit + noise.residual_floor) * sighting.covariance
        turn = se3.turn(pose[:3, :3])
        covariance = turn @ own @ turn.T
        if len(group.members) > 1:
            fractions = np.exp(hypotheses.log_weights[group.members] - total) / group.weight
            symmetry = belief.objects[group.object].symmetry.exact
            others = symmetry.nearest(hypotheses.poses[group.members] @ belief.since, pose)
            covariance = covariance + _scatter(others, fractions, pose)
        out.append(Mode(group.weight, pose, covariance, len(group.members)))
    return out


def covariance_of(belief: Belief, number: int, modes: Sequence[Mode]) -> np.ndarray:
    """Return the covariance (6, 6) of the belief about one object, given its modes.

    It is about the first mode's pose, in the order and axes of `Mode.covariance`.

    A mode's own covariance is the uncertainty of its pose if it is the right mode. The published covariance also
    includes the distance to the truth if another mode is right.
    """
    first = modes[0]
    others = modes[1:]
    poses = [mode.pose for mode in others]
    weights = [mode.weight for mode in others]
    some = belief.untested[number]
    if len(some) and (mass := np.exp(some.log_weights - belief.total())).sum() > _NEGLIGIBLE:
        rows = kernels.systematic(mass, 64, 0.5)
        poses.extend(some.some(rows).poses @ belief.since)
        weights.extend([float(mass.sum()) / 64] * 64)
    if not poses:
        return first.covariance
    left = np.array(weights) / (first.weight + sum(weights))  # of this object: others have frames of their own
    return first.covariance * (1.0 - left.sum()) + _scatter(np.stack(poses), left, first.pose)


def _scatter(poses: np.ndarray, weights: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the second moment (6, 6) of position and rotation vector of weighted poses (n, 4, 4) about a centre."""
    turned = poses[:, :3, :3] @ centre[:3, :3].T
    offset = np.concatenate([poses[:, :3, 3] - centre[:3, 3], se3.log(se3.make(turned, np.zeros(3)))[:, 3:]], axis=1)
    return np.einsum("n,ni,nj->ij", weights, offset, offset)


def draws(belief: Belief, number: int, count: int, seed: int) -> np.ndarray:
    """Draw equally weighted poses (count, 4, 4) at present from the hypotheses and untested poses on one object."""
    rng = np.random.default_rng(seed)
    hypotheses, some = belief.hypotheses.some(belief.hypotheses.objects == number), belief.untested[number]
    log_weights = np.concatenate([hypotheses.log_weights, some.log_weights])
    chosen = kernels.systematic(np.exp(log_weights - log_weights.max()), count, rng.random())
    out = []
    own, rows = chosen[chosen < len(hypotheses)], chosen[chosen >= len(hypotheses)] - len(hypotheses)
    if len(own):
        factors = np.linalg.cholesky(hypotheses.covariances[own] + _HARDLY_ANY * np.eye(6))
        noise = np.einsum("nij,nj->ni", factors, rng.standard_normal((len(own), 6)))
        out.append(hypotheses.poses[own] @ se3.exp(noise))
    if len(rows):
        out.append(some.some(rows).poses)
    return np.concatenate(out) @ belief.since
