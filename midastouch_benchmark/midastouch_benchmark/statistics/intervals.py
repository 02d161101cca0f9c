"""95 % confidence intervals over trials that are not all independent: those on one slide share it.

The slides are the independent draws. Shares: Wilson's interval at the effective number of cases, which the variance
between slides gives (design effect, Kish 1965). Means and medians: percentile bootstrap over slides.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np
from scipy.stats import norm

LEVEL = 0.95
ENOUGH = 100
"""Fewer trials than this are no ground for a claim."""

_RESAMPLES = 1000


def share_interval(part: Sequence[float], whole: Sequence[float], groups: Sequence[Hashable]) -> list[float] | None:
    """[low, high] of sum(part) / sum(whole), both (N,) per trial; groups (N,), which trials belong together. None
    where nothing was counted.

    Without any variance between groups, as at a share of 0 or 1, each group in which something was counted is one case.
    """
    index, n_groups = _numbered(groups)
    part, whole = (np.bincount(index, np.asarray(one, float), n_groups) for one in (part, whole))
    total = whole.sum()
    if not total:
        return None
    p, counted = part.sum() / total, np.count_nonzero(whole)
    spread = np.square(part - p * whole).sum() / total**2 * counted / max(counted - 1, 1)
    cases = float(np.clip(p * (1 - p) / spread, 1, total)) if spread > 0 else float(counted)
    z = norm.ppf(0.5 + LEVEL / 2)
    middle = (p + z**2 / (2 * cases)) / (1 + z**2 / cases)
    half = z / (1 + z**2 / cases) * np.sqrt(p * (1 - p) / cases + z**2 / (4 * cases**2))
    return [round(float(bound), 9) + 0.0 for bound in (middle - half, middle + half)]  # no -0


def bootstrap_interval(
    values: Sequence[float], groups: Sequence[Hashable], statistic: Callable[..., np.ndarray] = np.mean
) -> list[float] | None:
    """[low, high] of a mean (`np.mean`) or median (`np.median`) of values (N,), nan left out; groups as above.

    Medians may be of values that are infinite. None with fewer than two groups.
    """
    values = np.asarray(values, float)
    known = ~np.isnan(values)
    index, n_groups = _numbered([group for group, ok in zip(groups, known, strict=True) if ok])
    if n_groups < 2:
        return None
    rng = np.random.default_rng(0)
    times_drawn = rng.multinomial(n_groups, np.full(n_groups, 1 / n_groups), size=_RESAMPLES)
    drawn = _STATISTICS[statistic](values[known], times_drawn[:, index])
    return np.quantile(drawn, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], method="nearest").tolist()


def _means(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Means (R,) of values (N,), each counted as often as the row of the weights (R, N) says."""
    return weights @ values / weights.sum(axis=1)


def _medians(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Medians (R,), likewise; of an even number the lower."""
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weights[:, order], axis=1)
    return values[order][np.argmax(2 * below >= below[:, -1:], axis=1)]


_STATISTICS = {np.mean: _means, np.median: _medians}


def _numbered(groups: Sequence[Hashable]) -> tuple[np.ndarray, int]:
    """Number of each item's group (N,), and how many groups there are."""
    numbers = {group: k for k, group in enumerate(dict.fromkeys(groups))}
    return np.array([numbers[group] for group in groups], int), len(numbers)
