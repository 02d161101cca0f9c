"""Two protocols over the same trials: how many times as large is the error?"""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common.errors import InputError

_DRAWS = 4000
_LEVEL = 0.95


@dataclasses.dataclass(frozen=True)
class Ratio:
    """value, of mean errors; low and high, ends of its 95 % interval; median, of the pairs' own ratios; pairs."""

    value: float
    low: float
    high: float
    median: float
    pairs: int


def error_ratio(trials: list[dict], base: list[dict]) -> Ratio:
    """Final error of the particles in trials over that of others, paired by object, slide, start and seed.

    The interval is a bootstrap over slides: trials on one slide are alike. Raises InputError if no trial has a partner.
    """
    one, other = ({_identity(trial): trial["final"]["e_trans_mm"] for trial in each} for each in (trials, base))
    common = sorted(one.keys() & other.keys())
    if not common:
        raise InputError("no trial has a partner in the other result; run both over the same slides and seeds")
    values = np.array([[one[key], other[key]] for key in common])
    slides = sorted({key[:2] for key in common})
    sums = np.array([values[[key[:2] == slide for key in common]].sum(axis=0) for slide in slides])
    drawn = sums[np.random.default_rng(0).integers(len(slides), size=(_DRAWS, len(slides)))].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], [(1 - _LEVEL) / 2, (1 + _LEVEL) / 2])
    total = values.sum(axis=0)
    median = float(np.median(values[:, 0] / values[:, 1]))
    return Ratio(float(total[0] / total[1]), float(low), float(high), median, len(common))


def _identity(trial: dict) -> tuple:
    return tuple(trial[key] for key in ("object", "slide", "init", "seed"))
