"""Figures of the accuracy over many trials: summaries per object, calibration, the terminal's tables."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from .calibration import KINDS, LEVELS, observed_shares
from .comparison import comparison_table, front_text, rows_by_init, wrong_converged
from .summary import summarise_trials
from .table import number, text_table
from .variants import DEFAULT

_NAMED_LEVELS = (0.5, 0.9, 0.95, 0.99)
_IN_FULL = (DEFAULT, "paper")
_SUMMARISED = ("coverage", "filter_stages_ms", "initial", "protocol")
_PAPER = {"particles": ("e", "mean", 7.4, 9.43), "closest mode": ("min_cluster", "median", 2.8, 2.03)}
"""The paper's final errors over its ten objects in simulation: metric, statistic, mm, deg."""


def summarise_accuracy(trials: list[dict]) -> dict[str, dict[str, dict]]:
    """Summary by variant and init, each over all trials; of the default and the paper's filter per object too."""
    groups: dict[str, dict[str, list[dict]]] = {}
    for trial in trials:
        groups.setdefault(trial["variant"], {}).setdefault(trial["init"], []).append(trial)
    return {
        variant: {init: _summary(some, variant in _IN_FULL) for init, some in by_init.items()}
        for variant, by_init in groups.items()
    }


def _summary(trials: list[dict], in_full: bool) -> dict:
    out = summarise_trials(trials) | {
        "coverage": coverage(trials),
        "recovery": recovery(trials),
        "filter_stages_ms": stage_means(trials),
        "wrong_converged": wrong_converged(trials),
    }
    if not in_full:
        del out["objects"]
        return out
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
    """How the filter came back after the sensor had been lifted: trials; recovered, in how many it was right from some
    frame to the end; median_frames and p90_frames of sliding until then. None if no trial was lifted."""
    lifted = [t for t in trials if t["touched_again_at"] is not None]
    if not lifted:
        return None
    frames = [
        max(t["right_from_frame"] - t["touched_again_at"], 0) for t in lifted if t["right_from_frame"] is not None
    ]
    out = {"trials": len(lifted), "recovered": len(frames)}
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


def object_table(summary: dict, objects: list[dict]) -> tuple[list[str], list[list[object]]]:
    """Header and rows, one per object and one for all, of one variant and init."""
    symmetry = {one["object"]: one["symmetry"] for one in objects}
    header = ["object", "symmetry", "trials", "particles mm", "deg", "modulo symmetry mm", "deg", "closest mode mm"]
    header += ["deg", "pose mm", "p90", "modulo symmetry", "right", "modulo symmetry", "converged"]
    header += ["converged but wrong", "Hz"]
    rows = []
    for name, one in [*summary["objects"].items(), ("all", summary)]:
        cells: list[object] = [name, symmetry.get(name, ""), one["trials"]]
        cells += _pair(one, "e", "mean") + _pair(one, "symmetric_e", "mean") + _pair(one, "min_cluster", "median")
        cells += [number(one["estimate_trans_mm"].get(statistic)) for statistic in ("median", "p90")]
        cells += _pair(one, "symmetric_estimate", "median")[:1]
        cells += [share(one[key], one["trials"]) for key in ("right", "right_symmetric", "converged")]
        cells += [f"{100 * one['wrong_converged']:.1f} % of frames", number(one["hz_mean"])]
        rows.append(cells)
    return header, rows


def paper_text(summary: dict) -> str:
    """One line on the paper's figures, with those of a summary as a share of them."""
    parts = []
    for name, (prefix, statistic, mm, deg) in _PAPER.items():
        own = [summary[f"{prefix}_{unit}"].get(statistic) for unit in ("trans_mm", "rot_deg")]
        shares = [number(None if one is None else one / theirs, 2) for one, theirs in zip(own, (mm, deg), strict=True)]
        parts.append(f"{name} {statistic} {mm} mm, {deg} deg (here {shares[0]}, {shares[1]} of it)")
    return f"the paper on its ten objects, simulated: {'; '.join(parts)}"


def recovery_text(back: dict) -> str:
    """One line on `recovery`."""
    after = (
        f" after {number(back['median_frames'], 0)} frames of sliding (median), {number(back['p90_frames'], 0)} (p90)"
        if back["recovered"]
        else ""
    )
    return f"right again in {back['recovered']} of {back['trials']} trials after the sensor was lifted{after}"


def share(part: int, whole: int) -> str:
    """`part` of `whole` in percent."""
    return f"{100 * part / whole:.0f} %"


def _pair(one: dict, prefix: str, statistic: str) -> list[str]:
    return [number(one.get(f"{prefix}_{unit}", {}).get(statistic)) for unit in ("trans_mm", "rot_deg")]


def coverage_table(levels: dict[str, dict]) -> tuple[list[str], list[list[object]]]:
    """Header and rows: by kind of frame, the share of frames whose truth lies within the 50, 90, 95, 99 % region, and
    the median of the normalised error squared."""
    where = [int(np.argmin(np.abs(LEVELS - level))) for level in _NAMED_LEVELS]
    rows = []
    for kind, one in levels.items():
        shares = [f"{100 * one['observed'][k]:.0f} %" if one["frames"] else "-" for k in where]
        beyond = f"> {chi2.ppf(LEVELS[-1], 6):.0f}" if one["frames"] else "-"
        nees = beyond if one["median_nees"] is None else number(one["median_nees"])
        rows.append([kind.replace("_", " "), one["frames"], *shares, nees])
    regions = [f"{100 * level:.0f} % region" for level in _NAMED_LEVELS]
    return ["frames", "number", *regions, f"median NEES (calibrated: {chi2.median(6):.1f})"], rows


def accuracy_text(result: dict) -> str:
    """Everything a terminal is shown."""
    parts = []
    for init, summary in result["summary"].get(DEFAULT, {}).items():
        parts.append(f"init {init}\n" + text_table(*object_table(summary, result["objects"]), left=2))
        if init == "paper":
            parts.append(paper_text(summary))
        parts.append("truth within the published Gaussian\n" + text_table(*coverage_table(summary["coverage"])))
        if summary["recovery"]:
            parts.append(recovery_text(summary["recovery"]))
    for init, rows in rows_by_init(result["comparison"]).items():
        if len(rows) > 1:
            table = text_table(*comparison_table(rows, result["variants"]))
            parts.append(f"variants, init {init}, all on the same trials\n{table}\n{front_text(rows)}")
    parts.append(
        "final errors: particles (Eq. 3) mean, closest mode (Eq. 4) and published pose median over trials; "
        "modulo symmetry: of the equivalent pose nearest to the truth; right: converged, and within 10 mm"
    )
    return "\n\n".join(parts)
