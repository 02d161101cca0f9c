"""Coverage of the filter's covariances and reliability of its weights: whether its probabilities are right.

Covariances and likelihood are judged by the level at which the truth is found. If a method is calibrated, its region of
probability q holds the truth in a fraction q of all cases, for every q. Likewise, a mode of weight q is right in a
fraction q of all cases.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import CONVERGED

LEVELS = np.array([*np.arange(0.05, 1.0, 0.05).round(2), 0.99, 0.999])
"""Upper ends of the bins in which levels are counted; a last bin holds what lies beyond."""

_NEES = chi2.ppf(LEVELS, 6)
WEIGHTS = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
"""Inner limits of the bins in which weights of modes are counted."""

KINDS = ("one_mode", "several_modes", "converged", "right")


def nees(estimate: Estimate, truth: np.ndarray) -> float:
    """Return the normalised estimation error squared of the published pose, e' C^-1 e; mean about 6 if C is right.

    e: translation [m] and rotation vector [rad] from the estimate to the truth (4, 4) `T_obj_gel`, in the object frame
    and the order of the covariance.
    """
    turn = truth[:3, :3] @ estimate.pose[:3, :3].T
    error = np.concatenate([truth[:3, 3] - estimate.pose[:3, 3], Rotation.from_matrix(turn).as_rotvec()])
    # identical particles have no spread: a floor of 1 um and 1e-4 rad keeps the covariance invertible
    covariance = estimate.covariance + np.diag(np.repeat([1e-12, 1e-8], 3))
    return float(error @ np.linalg.solve(covariance, error))


class Coverage:
    """Counter of the levels at which the published Gaussians hold the truth, by kind of frame.

    Kinds: `one_mode`, `several_modes`: number of reported modes; `converged`: the state; `right`: the pose is right by
    the trial's yardstick, which leaves wrong modes out and judges the covariance alone.
    """

    def __init__(self) -> None:
        self._counts = {kind: np.zeros(len(LEVELS) + 1, int) for kind in KINDS}

    def add(self, estimate: Estimate, truth: np.ndarray, right: bool) -> None:
        """Count a frame with a published pose; truth: (4, 4) `T_obj_gel`; right: whether the pose is right."""
        bin_ = int(np.searchsorted(_NEES, nees(estimate, truth)))
        status = estimate.status
        kinds = (status.n_modes == 1, status.n_modes > 1, status.state == CONVERGED, right)
        for kind, holds in zip(KINDS, kinds, strict=True):
            self._counts[kind][bin_] += holds

    def counts(self) -> dict[str, list[int]]:
        """Return the frames in each bin of `LEVELS` and in the one beyond, by kind."""
        return {kind: counts.tolist() for kind, counts in self._counts.items()}


class WeightReliability:
    """Counter of how often the published pose is right, by the weight of its mode."""

    def __init__(self) -> None:
        self._frames, self._right = (np.zeros(len(WEIGHTS) + 1, int) for _ in range(2))
        self._weight = np.zeros(len(WEIGHTS) + 1)

    def add(self, weight: float, right: bool) -> None:
        """Count a frame whose published pose is that of a mode of this weight."""
        bin_ = int(np.searchsorted(WEIGHTS, weight, side="right"))
        self._frames[bin_] += 1
        self._right[bin_] += right
        self._weight[bin_] += weight

    def counts(self) -> dict[str, list]:
        """Return frames, right ones and sum of weights, in each bin of `WEIGHTS`."""
        sums = np.round(self._weight, 3)
        return {"frames": self._frames.tolist(), "right": self._right.tolist(), "weight": sums.tolist()}


def observed_fractions(counts: np.ndarray) -> np.ndarray:
    """Return the fraction of cases in which the truth lies within each level (len(LEVELS),); nan without cases."""
    counts = np.asarray(counts, float)
    total = counts.sum()
    return np.cumsum(counts)[:-1] / total if total else np.full(len(LEVELS), np.nan)
