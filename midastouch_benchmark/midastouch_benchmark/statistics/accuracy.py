"""Summaries of the accuracy over many trials: by variant, start and object, with trust, calibration and recovery."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from ..trials.grasps import grasp_summary
from ..trials.variants import DEFAULT, PAPER, PEER, VARIANTS
from .comparison import wrong_converged
from .coverage import KINDS, LEVELS, observed_shares
from .summary import summarise_trials
from .trust import frames_until_right, trust

_SUMMARISED = ("coverage", "reliability", "filter_stages_ms", "initial", "protocol")


def summarise_accuracy(trials: list[dict]) -> dict[str, dict[str, dict]]:
    """Summary by variant and init, each over all trials; of the default and the paper's filter per object too."""
    groups: dict[str, dict[str, list[dict]]] = {}
    for trial in trials:
        groups.setdefault(trial["variant"], {}).setdefault(trial["init"], []).append(trial)
    in_full = {name for name in groups if VARIANTS[name].group in (DEFAULT, PAPER, PEER)}
    return {
        variant: {init: _summary(some, variant in in_full) for init, some in by_init.items()}
        for variant, by_init in groups.items()
    }


def _summary(trials: list[dict], in_full: bool) -> dict:
    out = summarise_trials(trials) | {
        "coverage": coverage(trials),
        "recovery": recovery(trials),
        "filter_stages_ms": stage_means(trials),
        "wrong_converged": wrong_converged(trials),
        "grasps": grasp_summary(trials),
    }
    if not in_full:
        del out["objects"]
        return out
    out["trust"] = trust(trials)
    for name, one in out["objects"].items():
        one["wrong_converged"] = wrong_converged([trial for trial in trials if trial["object"] == name])
    return out


def stage_means(trials: list[dict]) -> dict[str, float]:
    """Mean milliseconds per frame of each stage of the filter."""
    names = dict.fromkeys(name for t in trials for name in t["filter_stages_ms"])
    return {name: float(np.mean([t["filter_stages_ms"].get(name, 0.0) for t in trials])) for name in names}


def compact_trials(trials: list[dict]) -> list[dict]:
    """Trials for a result file: without what the summaries hold as well."""
    return [
        {key: value for key, value in trial.items() if key not in _SUMMARISED}
        | {"final": {k: v for k, v in trial["final"].items() if not k.startswith("closest_mode")}}
        for trial in trials
    ]


def recovery(trials: list[dict]) -> dict | None:
    """How the filter came back after an event: trials; recovered, in how many it was right from some frame to the end;
    median_frames and p90_frames of sliding until then. None if nothing happened."""
    disturbed = [t for t in trials if t["event_at"] is not None]
    if not disturbed:
        return None
    frames = [frames_until_right(t) for t in disturbed if t["right_from_frame"] is not None]
    out = {"trials": len(disturbed), "recovered": len(frames)}
    if frames:
        out |= {"median_frames": float(np.median(frames)), "p90_frames": float(np.percentile(frames, 90))}
    return out


def coverage(trials: list[dict]) -> dict[str, dict]:
    """By kind of frame: number of frames; observed, share of them whose truth lies within each of `LEVELS`;
    median_nees, of the normalised estimation error squared, 5.3 if calibrated, None beyond the last level."""
    out = {}
    for kind in KINDS:
        counts = np.sum([trial["coverage"][kind] for trial in trials], axis=0)
        observed = observed_shares(counts)
        out[kind] = {"frames": int(counts.sum()), "observed": observed, "median_nees": _median_nees(observed)}
    return out


def _median_nees(observed: np.ndarray) -> float | None:
    """Median of a chi-square of six degrees from the shares (L,) within each of `LEVELS`."""
    if not observed[-1] >= 0.5:
        return None
    return float(chi2.ppf(np.interp(0.5, [0, *observed], [0, *LEVELS]), 6))
