"""Coverage of the filter's covariances and reliability of its weights: whether its probabilities are right.

Covariances and likelihood are judged by the level at which the truth is found. If a method is calibrated, its region of
probability q holds the truth in a fraction q of all cases, for every q. Likewise, a mode of weight q is right in a
fraction q of all cases.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
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


def level_counts(frames: pd.DataFrame) -> dict[str, list[int]]:
    """Return the frames in each bin of `LEVELS` and in the one beyond, by kind: how often Gaussians hold the truth.

    Kinds: `one_mode`, `several_modes`: number of reported modes; `converged`: the state; `right`: the pose is right by
    the trial's yardstick, which leaves wrong modes out and judges the covariance alone. frames: with columns nees,
    n_modes, state, right.
    """
    modes = frames["n_modes"]
    kinds = dict(zip(KINDS, (modes == 1, modes > 1, frames["state"] == CONVERGED, frames["right"]), strict=True))
    bins = np.searchsorted(_NEES, frames["nees"].astype(float))
    return {kind: np.bincount(bins, holds, len(LEVELS) + 1).astype(int).tolist() for kind, holds in kinds.items()}


def weight_counts(frames: pd.DataFrame) -> dict[str, list]:
    """Return frames and right ones in each bin of `WEIGHTS`: how often the published pose is right, by the weight of
    its mode. frames: with columns mode_mass and right."""
    bins = np.searchsorted(WEIGHTS, frames["mode_mass"], side="right")
    kinds = {"frames": np.ones(len(bins)), "right": frames["right"]}
    return {kind: np.bincount(bins, each, len(WEIGHTS) + 1).astype(int).tolist() for kind, each in kinds.items()}


def observed_fractions(counts: np.ndarray) -> np.ndarray:
    """Return the fraction of cases in which the truth lies within each level (len(LEVELS),); nan without cases."""
    counts = np.asarray(counts, float)
    total = counts.sum()
    return np.cumsum(counts)[:-1] / total if total else np.full(len(LEVELS), np.nan)
