"""How much the touches along slides are expected to say for the hypothesis that is right, against each other one.

If i is right, the finger follows i's surface, and a touch is as i's path has it there. The arm's motion says where j
has the gel then; how well would the touch fit there? By codes: it has the code of one of the codebook's entries around,
and is scored against the others around i, and against those around j. By maps, between two narrow hypotheses: the map
that i's path renders is aligned to the object from j's pose. Where j has the gel off its surface the touch speaks as
much against it as one can: the filter's surface constraint weighs codes down, and nothing explains a map there.
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
_USUAL_POSES = 16  # poses, that say what is usual
_SAME_COSINE = 1.0 - 1e-5  # cosine of a code with itself, in single precision


def by_model(hypotheses: Sequence[Hypothesis]) -> Iterator[tuple[ObjectModel, np.ndarray]]:
    """Each object's model and the numbers (G,) of its hypotheses."""
    for model in dict.fromkeys(each.model for each in hypotheses):
        yield model, np.flatnonzero([each.model is model for each in hypotheses])


def carried_along(starts: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Poses (H, N, H, 4, 4): where hypothesis j (last) has the gel at touch n if i (first) is right.

    starts (H, 4, 4), where each has it now; ways (H, N, 4, 4), where each would have it at N touches if it is right.
    """
    motion = se3.inverse(starts)[:, None] @ ways
    return starts @ motion[:, :, None]


def code_evidence(hypotheses: Sequence[Hypothesis], poses: np.ndarray) -> np.ndarray:
    """Nats (H, N, H) that the code of a touch speaks for hypothesis i (first axis) against j (last axis) if i is right.

    poses (H, N, H, 4, 4), as `carried_along`. Where i and j are alike it scatters about 0.
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
    others = cosines < _SAME_COSINE  # the touch is none of the entries itself
    shape = *cosines.shape[:3], len(hypotheses), _AROUND
    similar = np.where(others, measurement.similarity(cosines), 0).reshape(shape).sum(axis=4)
    mean = similar / np.maximum(others.reshape(shape).sum(axis=4), 1)
    score = measurement.log_ratio_between(touch.reshape(-1, touch.shape[3]), mean.reshape(-1, len(hypotheses)))
    score = np.maximum(score.reshape(shape[:4]) + log_weight[:, :, None], np.log(measurement.outlier))
    of_right = score[every, :, :, every][..., None]
    return (of_right - score).mean(axis=2)


def in_reach(model: ObjectModel, poses: np.ndarray) -> np.ndarray:
    """Whether gels at poses (N, 4, 4) are near enough to the surface to touch it, (N,)."""
    return np.abs(_off(model, poses)) <= DEAD_DISTANCE


def _off(model: ObjectModel, poses: np.ndarray) -> np.ndarray:
    """How far (N,) [m] gels at poses (N, 4, 4) are over where they would be pressed as those of codebooks are."""
    return model.surface.distance(poses[:, :3, 3]) + PRESS


def unexplained(model: ObjectModel, poses: np.ndarray, maps: np.ndarray, noise: NoiseModel) -> np.ndarray:
    """Fraction (N,) of each map that is left once poses (N, 4, 4) `in_reach`, known as well as entries are, are aligned
    to it. They are moved along their axes onto the surface first: no contact would have no slope to align along."""
    settled = se3.make(poses[:, :3, :3], poses[:, :3, 3] - _off(model, poses)[:, None] * poses[:, :3, 2])
    align = model.alignment.align
    pairs = list(zip(settled, maps, strict=True))
    return 1.0 - np.array(model.workers.map(lambda pair: align(pair[0], noise.between_entries, pair[1]).fit, pairs))


def usually_unexplained(right: Hypothesis, poses: np.ndarray, noise: NoiseModel) -> float:
    """Fraction of a rendered map that the right hypothesis leaves: what alignment from as far off as entries lie leaves
    of those at some of its poses (N, 4, 4)."""
    some = poses[:: max(len(poses) // _USUAL_POSES, 1)]
    directions = np.random.default_rng(0).standard_normal((len(some), 6))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    off = some @ se3.exp(np.sqrt(np.diag(noise.between_entries)) * directions)
    return float(np.median(unexplained(right.model, off, right.model.alignment.render(some), noise)))


def map_evidence(
    right: Hypothesis,
    wrong: Sequence[Hypothesis],
    at_right: np.ndarray,
    at_wrong: np.ndarray,
    noise: NoiseModel,
) -> np.ndarray:
    """Nats (N, W) >= 0 that the maps of touches at poses `at_right` (N, 4, 4) speak for the right hypothesis against
    each of W wrong ones, which have the gel at poses `at_wrong` (N, W, 4, 4). All are narrow. Out of reach of the
    surface nothing is explained; what is wrong with real maps, as with the last one, no hypothesis explains. Nor
    is it evidence what the right hypothesis itself leaves of a touch, as where the gel tilts over an edge."""
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
    usual = np.minimum(np.maximum(usual, own) + real, 1.0)[:, None]
    found = np.minimum(found + real, 1.0)
    # a touch of which less is left than usual is simple, not evidence against the right hypothesis
    return np.maximum(noise.residual_evidence(usual) - noise.residual_evidence(found), 0.0)
