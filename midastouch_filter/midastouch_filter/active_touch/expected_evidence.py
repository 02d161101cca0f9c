"""Expected evidence of touches along slides for the right hypothesis, against each other one.

If i is right, the finger follows i's surface, and a touch measures what i's path predicts. By the arm's motion, j has
the gel at another pose then; how well does the touch fit there? By codes: the touch has the code of one of the
codebook's entries around i's pose, and is scored against the others around i, and against those around j. By maps,
between two narrow hypotheses: the map rendered on i's path is aligned to the object from j's pose. If j has the gel off
its surface, the touch speaks as much against j as a touch can: a distance from the codebook's poses costs weight, and
nothing explains a map there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from midastouch_common import se3
from midastouch_perception.codebook import PRESS

from ..core.noise_model import NoiseModel
from ..core.object_model import ObjectModel
from ..core.surface import DEAD_DISTANCE
from .hypotheses import Hypothesis
from .slide_prediction import nearest_and_log_weight

_AROUND = 9  # entries around a pose: the nearest one and eight more, between which the true one lies
_USUAL_POSES = 16  # poses from which the usual residual is found
_SAME_COSINE = 1.0 - 1e-5  # cosine of a code with itself, in single precision


def by_model(hypotheses: Sequence[Hypothesis]) -> Iterator[tuple[ObjectModel, np.ndarray]]:
    """Yield each object's model and the numbers (G,) of its hypotheses."""
    for model in dict.fromkeys(each.model for each in hypotheses):
        yield model, np.flatnonzero([each.model is model for each in hypotheses])


def carried_along(starts: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return the gel's poses (H, N, H, 4, 4) by hypothesis j (last) at touch n if i (first) is right.

    starts (H, 4, 4): its pose now by each hypothesis; ways (H, N, 4, 4): at N touches by each, if that one is right.
    """
    motion = se3.inverse(starts)[:, None] @ ways
    return starts @ motion[:, :, None]


def code_evidence(hypotheses: Sequence[Hypothesis], poses: np.ndarray) -> np.ndarray:
    """Return the nats (H, N, H) of a touch's code for hypothesis i (first axis) against j (last axis) if i is right.

    poses (H, N, H, 4, 4), from `carried_along`. If i and j are alike, the nats scatter about 0.
    """
    measurement, shape = hypotheses[0].model.measurement, poses.shape[:3]
    codes, log_weight = np.empty((*shape, _AROUND, measurement.dimension), np.float32), np.empty(shape)
    for model, group in by_model(hypotheses):
        some = poses[:, :, group]
        entries, log_weight[:, :, group] = nearest_and_log_weight(model, some)
        around = model.lookup.around(entries.ravel(), _AROUND)
        codes[:, :, group] = model.measurement.codes[around].reshape(*some.shape[:3], _AROUND, -1)
    every = np.arange(len(hypotheses))
    touch = codes[every, :, every]
    cosines = touch @ codes.reshape(*shape[:2], -1, measurement.dimension).swapaxes(2, 3)
    others = cosines < _SAME_COSINE  # an entry is not scored against itself
    shape = *cosines.shape[:3], len(hypotheses), _AROUND
    similar = np.where(others, measurement.similarity(cosines), 0).reshape(shape).sum(axis=4)
    mean = similar / np.maximum(others.reshape(shape).sum(axis=4), 1)
    score = measurement.log_ratio_between(touch.reshape(-1, touch.shape[3]), mean.reshape(-1, len(hypotheses)))
    score = np.maximum(score.reshape(shape[:4]) + log_weight[:, :, None], np.log(measurement.outlier))
    of_right = score[every, :, :, every][..., None]
    return (of_right - score).mean(axis=2)


def in_reach(model: ObjectModel, poses: np.ndarray) -> np.ndarray:
    """Return whether gels at poses (N, 4, 4) are near enough to the surface to touch it, (N,)."""
    return np.abs(_off(model, poses)) <= DEAD_DISTANCE


def _off(model: ObjectModel, poses: np.ndarray) -> np.ndarray:
    """Return how far (N,) [m] gels at poses (N, 4, 4) are above the depth at which a codebook's gels are pressed."""
    return model.surface.distance(poses[:, :3, 3]) + PRESS


def unexplained(model: ObjectModel, poses: np.ndarray, maps: np.ndarray, noise: NoiseModel) -> np.ndarray:
    """Return the fraction (N,) of each map that stays unexplained once poses (N, 4, 4) `in_reach`, known as well as
    entries are, are aligned to it. They are first moved along their axes onto the surface: without contact there is no
    slope to align along."""
    settled = se3.make(poses[:, :3, :3], poses[:, :3, 3] - _off(model, poses)[:, None] * poses[:, :3, 2])
    align = model.alignment.align
    pairs = list(zip(settled, maps, strict=True))
    return 1.0 - np.array(model.workers.map(lambda pair: align(pair[0], noise.between_entries, pair[1]).fit, pairs))


def usually_unexplained(right: Hypothesis, poses: np.ndarray, noise: NoiseModel) -> float:
    """Return the fraction of a rendered map that the right hypothesis usually leaves unexplained, at some of its poses
    (N, 4, 4): alignment starts as far off as entries lie."""
    some = poses[:: max(len(poses) // _USUAL_POSES, 1)]
    directions = np.random.default_rng(0).standard_normal((len(some), 6))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    off = some @ se3.exp(np.sqrt(np.diag(noise.between_entries)) * directions)
    return float(np.median(unexplained(right.model, off, right.model.alignment.render(some), noise)))


def map_evidence(
    right: Hypothesis, wrong: Sequence[Hypothesis], at_right: np.ndarray, at_wrong: np.ndarray, noise: NoiseModel
) -> np.ndarray:
    """Return the nats (N, W) >= 0 of the maps of touches at poses `at_right` (N, 4, 4) for the right hypothesis against
    each of W wrong ones, which have the gel at poses `at_wrong` (N, W, 4, 4). All are narrow. Out of reach of the
    surface nothing is explained. No hypothesis explains the errors of real maps, which are those of the last one. A
    residual that the right hypothesis leaves, too, as when the gel tilts over an edge, is no evidence."""
    if not len(at_right):
        return np.zeros(at_wrong.shape[:2])
    usual = usually_unexplained(right, at_right, noise)
    near = np.stack([in_reach(each.model, at_wrong[:, k]) for k, each in enumerate(wrong)], axis=1)
    reached = np.flatnonzero(near.any(axis=1))
    maps = np.empty((len(at_right), *right.model.alignment.map_shape), np.float32)
    maps[reached] = right.model.alignment.render(at_right[reached])
    found = np.ones(near.shape)
    for k, each in enumerate(wrong):
        some = near[:, k]
        found[some, k] = unexplained(each.model, at_wrong[some, k], maps[some], noise)
    real = right.residual_ratio if right.residual_ratio is not None else 1.0 - right.model.config.penetration_fit
    own = np.zeros(len(at_right))
    own[reached] = unexplained(right.model, at_right[reached], maps[reached], noise)
    at_most = np.minimum(np.maximum(usual, own) + real, 1.0)[:, None]
    found = np.minimum(found + real, 1.0)
    # a touch that leaves less than usual is simple, not evidence against the right hypothesis
    return np.maximum(noise.residual_evidence(at_most) - noise.residual_evidence(found), 0.0)
