"""95 % confidence intervals over trials that are not all independent: those on one slide share it.

The slides are the independent draws. Fractions have Wilson's interval at the effective number of cases, which follows
from the variance between slides (design effect, Kish 1965). Means and medians have a percentile bootstrap over slides.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.stats import norm

from midastouch_common.errors import InputError

LEVEL = 0.95
ENOUGH = 100
"""Fewer trials than this are no ground for a claim."""

_RESAMPLES = 1000
_TELLING = 10  # groups with some of the part, and with some of the rest, that make their variance known


def fraction_interval(part: npt.ArrayLike, whole: npt.ArrayLike, groups: Sequence[Hashable]) -> list[float] | None:
    """Return the interval [low, high] of sum(part) / sum(whole); None if nothing was counted.

    part, whole: (N,), one number per trial; groups: (N,), equal for trials that belong together. If few groups hold any
    of the part, or of the rest, the variance between groups is not known. The cases are then no more than the groups in
    which something was counted; otherwise one wrong frame would give a narrower interval than none.
    """
    index, different = pd.factorize(pd.Series(groups, dtype=object))
    part, whole = (np.bincount(index, np.asarray(one, float), len(different)) for one in (part, whole))
    total = whole.sum()
    if not total:
        return None
    p, counted = part.sum() / total, np.count_nonzero(whole)
    spread = np.square(part - p * whole).sum() / total**2 * counted / max(counted - 1, 1)
    telling = min(np.count_nonzero(part), np.count_nonzero(whole - part)) >= _TELLING
    most = total if telling else counted
    cases = float(np.clip(p * (1 - p) / spread, 1, most)) if spread > 0 else float(counted)
    z = norm.ppf(0.5 + LEVEL / 2)
    middle = (p + z**2 / (2 * cases)) / (1 + z**2 / cases)
    half = z / (1 + z**2 / cases) * np.sqrt(p * (1 - p) / cases + z**2 / (4 * cases**2))
    return [round(float(bound), 9) + 0.0 for bound in (middle - half, middle + half)]  # no -0


def bootstrap_interval(
    values: npt.ArrayLike, groups: Sequence[Hashable], statistic: Callable[..., np.ndarray] = np.mean
) -> list[float] | None:
    """Return the interval [low, high] of the mean (`np.mean`) or median (`np.median`) of values (N,), nan left out.

    groups: as of `fraction_interval`; with fewer than two, None is returned. Medians allow infinite values.
    """
    values = np.asarray(values, float)
    known = ~np.isnan(values)
    index, different = pd.factorize(pd.Series(groups, dtype=object)[known])
    if (count := len(different)) < 2:
        return None
    times_drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=_RESAMPLES)
    drawn = _STATISTICS[statistic](values[known], times_drawn[:, index])
    return np.quantile(drawn, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], method="nearest").tolist()


def _means(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return R means (R,) of values (N,); a row of the weights (R, N) gives how often each value counts."""
    return weights @ values / weights.sum(axis=1)


def _medians(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return R medians (R,), weighted as in `_means`; of an even number of values the lower."""
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weights[:, order], axis=1)
    return values[order][np.argmax(2 * below >= below[:, -1:], axis=1)]


_STATISTICS = {np.mean: _means, np.median: _medians}


class Figures:
    """Figures over trials, one number of each; groups (N,): equal for trials that belong together."""

    def __init__(self, groups: Sequence[Hashable]):
        self._groups = groups

    @classmethod
    def by_slide(cls, trials: Sequence[dict]) -> Figures:
        """Group trials by object and slide: those on one slide are not independent."""
        return cls([(trial["object"], trial["slide"]) for trial in trials])

    @classmethod
    def by_seed(cls, trials: Sequence[dict]) -> Figures:
        """Group trials by object and seed: those with one seed begin alike, so they are not independent."""
        return cls([(trial["object"], trial["seed"]) for trial in trials])

    def fraction(self, part: np.ndarray | Sequence, whole: np.ndarray | Sequence | None = None) -> dict:
        """Return {"share", "interval"} of sum(part) / sum(whole); without `whole`, of the number of trials."""
        whole = np.ones(len(part)) if whole is None else whole
        total = float(np.sum(whole))
        return {
            "share": float(np.sum(part)) / total if total else None,
            "interval": fraction_interval(part, whole, self._groups),
        }

    def value(self, some: npt.ArrayLike, statistic: Callable[..., np.ndarray]) -> dict:
        """Return {"value", "interval"} of the numbers that are not nan; statistic: `np.mean` or `np.median`."""
        some = np.array(some, float)
        known = some[~np.isnan(some)]
        return {
            "value": float(statistic(known)) if len(known) else None,
            "interval": bootstrap_interval(some, self._groups, statistic),
        }

    def values(self, some: npt.ArrayLike) -> dict:
        """Return mean and median, each as {"value", "interval"}."""
        return {"mean": self.value(some, np.mean), "median": self.value(some, np.median)}


_DRAWS = 4000


def error_ratio(trials: list[dict], base: list[dict]) -> dict[str, float]:
    """Return the final error of the particles over that of `base`, trials paired by object, slide, start and seed.

    value: ratio of the mean errors; low, high: ends of its 95 % interval; median: of the pairs' own ratios. The
    interval is a bootstrap over slides: trials on one slide are alike. Raises InputError if no trial has a partner.
    """
    one, other = ({identity(trial): trial["final"]["e_trans_mm"] for trial in each} for each in (trials, base))
    common = sorted(one.keys() & other.keys())
    if not common:
        raise InputError("no trial has a partner in the other result; run both over the same slides and seeds")
    values = np.array([[one[key], other[key]] for key in common])
    slides = sorted({key[:2] for key in common})
    sums = np.array([values[[key[:2] == slide for key in common]].sum(axis=0) for slide in slides])
    drawn = sums[np.random.default_rng(0).integers(len(slides), size=(_DRAWS, len(slides)))].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    total = values.sum(axis=0)
    median = float(np.median(values[:, 0] / values[:, 1]))
    return {"value": float(total[0] / total[1]), "low": float(low), "high": float(high), "median": median}


def identity(trial: dict) -> tuple:
    """Return object, slide, start and seed of a trial, by which trials are paired."""
    return tuple(trial[key] for key in ("object", "slide", "init", "seed"))
