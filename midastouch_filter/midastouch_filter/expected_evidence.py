"""How much the touches along slides are expected to say for the place that is right, against each other one.

Each hypothesis has its own predicted path. If i is right, a touch feels as i's path has it there; how well would it fit
j's path? By codes: a touch at i has the code of one of the codebook's entries around, and is scored against the others
around i, and against those around j. By maps, between two narrow places: the map that i's path renders is aligned to
the object from j's path. That the arm's motion may fit i's surface better than j's is left out: more may be learnt than
is promised.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from midastouch_perception import se3

from .hypotheses import Hypothesis
from .noise_model import NoiseModel
from .object_model import ObjectModel

_AROUND = 9  # entries around a pose: a place lies between them
_SOME = 16  # poses, from which it is told what is usual
_SAME = 1.0 - 1e-5  # cosine of a code with itself, in single precision


def by_model(hypotheses: Sequence[Hypothesis]) -> Iterator[tuple[ObjectModel, np.ndarray]]:
    """Each object's model and the numbers (G,) of its hypotheses."""
    for model in dict.fromkeys(each.model for each in hypotheses):
        yield model, np.flatnonzero([each.model is model for each in hypotheses])


def code_evidence(hypotheses: Sequence[Hypothesis], poses: np.ndarray) -> np.ndarray:
    """Nats (H, N, H) that the code of a touch speaks for hypothesis i (first axis) against j (last axis) if i is right.

    poses (H, N, 4, 4): where each hypothesis has the gel at N touches. Where i and j feel alike it scatters about 0.
    """
    measurement = hypotheses[0].model.measurement
    count, touches = poses.shape[:2]
    codes = np.empty((touches, count, _AROUND, measurement.dimension), np.float32)
    for model, group in by_model(hypotheses):
        entries = model.lookup.around(poses[group].reshape(-1, 4, 4), _AROUND)
        codes[:, group] = model.measurement.codes[entries].reshape(len(group), touches, _AROUND, -1).swapaxes(0, 1)
    flat = codes.reshape(touches, count * _AROUND, -1)
    cosines = flat @ flat.swapaxes(1, 2)
    others = cosines < _SAME  # the touch is none of the entries itself
    shape = touches, count, _AROUND, count, _AROUND
    similar = np.where(others, measurement.similarity(cosines), 0).reshape(shape).sum(axis=4)
    mean = similar / np.maximum(others.reshape(shape).sum(axis=4), 1)
    score = measurement.log_ratio_between(flat.reshape(-1, flat.shape[2]), mean.reshape(-1, count)).reshape(shape[:4])
    of_right = np.take_along_axis(score, np.arange(count)[None, :, None, None], axis=3)
    return (of_right - score).mean(axis=2).swapaxes(0, 1)


def unexplained(model: ObjectModel, poses: np.ndarray, maps: np.ndarray, noise: NoiseModel) -> np.ndarray:
    """Share (N,) of each map that is left once poses (N, 4, 4), known as well as entries are, are aligned to it."""
    align = model.alignment.align
    pairs = list(zip(poses, maps, strict=True))
    return 1.0 - np.array(model.workers.map(lambda pair: align(pair[0], noise.between_entries, pair[1]).fit, pairs))


def usually_unexplained(right: Hypothesis, poses: np.ndarray, noise: NoiseModel) -> float:
    """Share of a map that the right place leaves: what alignment from as far off as entries lie leaves of maps at some
    of its poses (N, 4, 4), and what it left of the last real map."""
    some = poses[:: max(len(poses) // _SOME, 1)]
    directions = np.random.default_rng(0).standard_normal((len(some), 6))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    off = some @ se3.exp(np.sqrt(np.diag(noise.between_entries)) * directions)
    found = unexplained(right.model, off, right.model.alignment.render(some), noise)
    real = right.misfit if right.misfit is not None else 1.0 - right.model.config.relief_fit
    return float(np.median(found)) + real


def map_evidence(
    right: Hypothesis, wrong: Hypothesis, at_right: np.ndarray, at_wrong: np.ndarray, noise: NoiseModel
) -> np.ndarray:
    """Nats (N,) >= 0 that the maps of touches at poses `at_right` (N, 4, 4) speak for the right place against the
    wrong one, which has the gel at poses `at_wrong` (N, 4, 4). Both are narrow."""
    if not len(at_right):
        return np.zeros(0)
    usual = usually_unexplained(right, at_right, noise)
    found = unexplained(wrong.model, at_wrong, right.model.alignment.render(at_right), noise)
    return np.maximum(noise.misfit_evidence(usual) - noise.misfit_evidence(np.minimum(found, 1.0)), 0.0)
