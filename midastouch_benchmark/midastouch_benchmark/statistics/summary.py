"""Figures over many trials: the `summary` of the `evaluate` JSON and the table printed at the end."""

from __future__ import annotations

from collections import Counter

import numpy as np

from midastouch_bringup.text_table import number, text_table
from midastouch_filter.core.state import CONVERGED

from ..trials.trial import ERROR_KEYS, STAGES, SYMMETRIC_KEYS


def summarise_trials(trials: list[dict]) -> dict:
    """Mean, median and largest final error per metric, rates and times, over all trials and per object."""
    objects = sorted({t["object"] for t in trials})
    return {
        **_summarise(trials),
        "objects": {name: _summarise([t for t in trials if t["object"] == name]) for name in objects},
    }


def final_errors(trials: list[dict], key: str) -> np.ndarray:
    """Final errors (N,) of one metric, nan where a trial has none; of a `symmetric_` one the plain error where the
    object has no symmetry."""
    plain = key.removeprefix("symmetric_")
    return np.array([t["final"].get(key, t["final"][plain]) for t in trials], float)


def is_right(trial: dict, key: str = "estimate_trans_mm") -> bool:
    """Whether the trial ended with a pose as near as is right, by the error named, and said so."""
    return trial["final"]["state"] == CONVERGED and bool(final_errors([trial], key)[0] <= 1e3 * trial["right_m"])


def _summarise(trials: list[dict]) -> dict:
    out: dict = {"trials": len(trials)}
    symmetric = any(key in t["final"] for t in trials for key in SYMMETRIC_KEYS)
    for key in (*ERROR_KEYS, *(SYMMETRIC_KEYS if symmetric else ())):
        # a trial without any mode or pose has no such error; it is counted, not hidden
        values = final_errors(trials, key)
        known = values[np.isfinite(values)]
        out[key] = {"missing": int(len(values) - len(known))}
        if len(known):
            out[key] |= {
                "mean": known.mean(),
                "median": np.median(known),
                "p90": np.percentile(known, 90),
                "max": known.max(),
            }
    out["initial"] = {k: np.array([t["initial"][k] for t in trials], float).mean() for k in ("e_trans_mm", "e_rot_deg")}
    out["states"] = dict(Counter(t["final"]["state"] for t in trials))
    out["converged"] = out["states"].get(CONVERGED, 0)
    out["right"] = sum(map(is_right, trials))
    out["right_symmetric"] = sum(is_right(trial, "symmetric_estimate_trans_mm") for trial in trials)
    out["hz_mean"] = np.mean([t["hz_mean"] for t in trials])
    out["hz_p05"] = min(t["hz_p05"] for t in trials)
    out["ms"] = {stage: np.mean([t["ms"][stage] for t in trials]) for stage in STAGES}
    return out


def summary_table(summary: dict) -> str:
    """Text table, one line per object and one for all: final errors, rates, states."""
    errors = ("particles mm", "deg", "closest mode mm", "deg", "pose mm", "deg")
    header = ["object", "trials", *errors, "Hz", "Hz p05", "converged", "right"]
    lines = dict(summary["objects"])
    if len(lines) > 1:
        lines["all"] = summary
    rows = []
    for name, one in lines.items():
        errors = [
            _value(one, "e", "mean"),
            _value(one, "min_cluster", "median"),
            _value(one, "estimate", "median"),
        ]
        flat = [cell for pair in errors for cell in pair]
        rates = [number(one["hz_mean"]), number(one["hz_p05"])]
        rows.append([name, one["trials"], *flat, *rates, one["converged"], one["right"]])
    note = (
        "final errors: particles (Eq. 3) mean over trials; closest mode (Eq. 4) and published pose median; "
        "right: converged, and within 10 mm"
    )
    return f"{text_table(header, rows)}\n{note}"


def _value(one: dict, prefix: str, statistic: str) -> tuple[str, str]:
    return tuple(number(one[f"{prefix}_{unit}"].get(statistic)) for unit in ("trans_mm", "rot_deg"))
