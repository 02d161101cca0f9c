"""Evidence of free space: the object is not at poses where a gel touched nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import log_ndtr

from .belief import Belief
from .noise_model import NoiseModel
from .object_model import ObjectModel

_TOUCHING = 1e-3  # m: deeper in the object a gel would have touched it


def refute(belief: Belief, gels: np.ndarray, noise: NoiseModel) -> None:
    """Weigh a belief by gels (A, 4, 4) that were in the air, in the present frame of the first finger's gel.

    Each pose gains the log-probability that all of them were outside the object, given how well the pose is known.
    """
    if not len(gels):
        return
    hypotheses, log_weights = belief.hypotheses, belief.hypotheses.log_weights.copy()
    variances = np.trace(hypotheses.covariances[:, :3, :3], axis1=1, axis2=2) / 3.0
    for number, model in enumerate(belief.objects):
        own, some = np.flatnonzero(hypotheses.objects == number), belief.untested[number]
        if len(own):
            log_weights[own] += _outside(model, hypotheses.poses[own], variances[own], gels, noise)
        if len(some):
            between = noise.between_entries[:1, 0]
            some.log_weights = some.log_weights + _outside(model, some.poses, between, gels, noise)
    belief.hypotheses = replace(hypotheses, log_weights=log_weights)


def _outside(
    model: ObjectModel, poses: np.ndarray, variances: np.ndarray, gels: np.ndarray, noise: NoiseModel
) -> np.ndarray:
    """Return the log-probability (n,) that all gels were outside, for poses (n, 4, 4) of these variances [m^2]."""
    at = (poses[:, :3, :3] @ gels[:, :3, 3].T).transpose(0, 2, 1) + poses[:, None, :3, 3]
    distance = model.surface.distance(at.reshape(-1, 3)).reshape(len(poses), len(gels)).min(axis=1)
    return np.maximum(log_ndtr((distance + _TOUCHING) / np.sqrt(variances + noise.jitter[0, 0])), noise.prior_floor)
