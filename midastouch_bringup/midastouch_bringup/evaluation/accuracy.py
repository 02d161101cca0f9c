"""Figures of the accuracy benchmark over its trials: summaries, comparison of variants, calibration."""

from __future__ import annotations

import numpy as np

from .calibration import KINDS, LEVELS, observed_shares
from .summary import final_errors, is_right, summarise_trials
from .table import number, text_table
from .trial import STAGES
from .variants import DEFAULT

_NAMED_LEVELS = (0.5, 0.9, 0.95, 0.99)
_IN_FULL = (DEFAULT, "paper")
_SUMMARISED = ("coverage", "filter_stages_ms", "initial", "protocol")
_IDENTITY = ("object", "slide", "init", "seed")


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
    }
    if not in_full:
        del out["objects"]
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
    """By kind of frame: number of frames, share of them whose truth lies within each of `LEVELS`."""
    out = {}
    for kind in KINDS:
        counts = np.sum([trial["coverage"][kind] for trial in trials], axis=0)
        out[kind] = {"frames": int(counts.sum()), "observed": observed_shares(counts)}
    return out


def compare_variants(trials: list[dict]) -> list[dict]:
    """One row per init and variant, over the trials that the default has run too, with ratios to the default.

    `error_ratio`, `rotation_ratio`: of the mean final particle errors; `estimate_ratio`: of the median error of the
    published pose; `filter_ratio`, `time_ratio`: of the mean time of the filter and of the whole frame.
    """
    by_variant: dict[tuple[str, str], dict[tuple, dict]] = {}
    for trial in trials:
        group = by_variant.setdefault((trial["init"], trial["variant"]), {})
        group[tuple(trial[key] for key in _IDENTITY)] = trial
    rows = []
    for (init, variant), own in by_variant.items():
        reference = by_variant.get((init, DEFAULT), {})
        common = sorted(own.keys() & reference.keys())
        if not common:
            continue
        one, base = (_figures([group[key] for key in common]) for group in (own, reference))
        ratios = {
            name: one[key] / base[key] if base[key] else None
            for name, key in (
                ("error_ratio", "e_trans_mm"),
                ("rotation_ratio", "e_rot_deg"),
                ("estimate_ratio", "estimate_trans_mm"),
                ("filter_ratio", "ms_filter"),
                ("time_ratio", "ms"),
            )
        }
        rows.append({"init": init, "variant": variant} | one | ratios)
    return rows


def _figures(trials: list[dict]) -> dict:
    def mean(key: str) -> float:
        return float(np.nanmean(final_errors(trials, key)))

    return {
        "trials": len(trials),
        "e_trans_mm": mean("e_trans_mm"),
        "e_rot_deg": mean("e_rot_deg"),
        "estimate_trans_mm": float(np.nanmedian(final_errors(trials, "estimate_trans_mm"))),
        "right": sum(map(is_right, trials)) / len(trials),
        "wrong_converged": _share(trials, "frames_converged") - _share(trials, "frames_converged_right"),
        "ms_filter": float(np.mean([t["ms"]["filter"] for t in trials])),
        "ms": float(np.mean([sum(t["ms"][stage] for stage in STAGES) for t in trials])),
    }


def _share(trials: list[dict], key: str) -> float:
    return sum(t[key] for t in trials) / max(sum(t["frames"] for t in trials), 1)


def pareto_front(rows: list[dict]) -> list[dict]:
    """The rows that no other beats in both time and error, fastest first."""
    front: list[dict] = []
    for row in sorted(rows, key=lambda r: (r["ms"], r["e_trans_mm"])):
        if not front or row["e_trans_mm"] < front[-1]["e_trans_mm"]:
            front.append(row)
    return front


def object_table(summary: dict, objects: list[dict]) -> tuple[list[str], list[list[object]]]:
    """Header and rows, one per object and one for all, of one variant and init."""
    symmetry = {one["object"]: one["symmetry"] for one in objects}
    header = ["object", "symmetry", "trials", "particles mm", "deg", "modulo symmetry mm", "deg", "closest mode mm"]
    header += ["deg", "pose mm", "p90", "modulo symmetry", "right", "modulo symmetry", "converged", "Hz"]
    rows = []
    for name, one in [*summary["objects"].items(), ("all", summary)]:
        cells: list[object] = [name, symmetry.get(name, ""), one["trials"]]
        cells += _pair(one, "e", "mean") + _pair(one, "symmetric_e", "mean") + _pair(one, "min_cluster", "median")
        cells += [number(one["estimate_trans_mm"].get(statistic)) for statistic in ("median", "p90")]
        cells += _pair(one, "symmetric_estimate", "median")[:1]
        cells += [share(one[key], one["trials"]) for key in ("right", "right_symmetric", "converged")]
        cells.append(number(one["hz_mean"]))
        rows.append(cells)
    return header, rows


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


def comparison_table(rows: list[dict], init: str) -> tuple[list[str], list[list[object]]]:
    """Header and rows of the variants under one init."""
    header = ["variant", "trials", "particles mm", "deg", "pose mm", "right", "converged but wrong", "filter ms"]
    header += ["frame ms", "error ratio", "deg ratio", "filter time ratio", "time ratio"]
    cells = []
    for row in rows:
        if row["init"] == init:
            cells.append(
                [row["variant"], row["trials"], number(row["e_trans_mm"]), number(row["e_rot_deg"])]
                + [number(row["estimate_trans_mm"]), f"{100 * row['right']:.0f} %"]
                + [f"{100 * row['wrong_converged']:.1f} % of frames", number(row["ms_filter"], 2), number(row["ms"], 2)]
                + [number(row[key], 2) for key in ("error_ratio", "rotation_ratio", "filter_ratio", "time_ratio")]
            )
    return header, cells


def coverage_table(levels: dict[str, dict]) -> tuple[list[str], list[list[object]]]:
    """Header and rows: by kind of frame, the share of frames whose truth lies within the 50, 90, 95, 99 % region."""
    where = [int(np.argmin(np.abs(LEVELS - level))) for level in _NAMED_LEVELS]
    rows = [
        [kind.replace("_", " "), one["frames"]]
        + [f"{100 * one['observed'][k]:.0f} %" if one["frames"] else "-" for k in where]
        for kind, one in levels.items()
    ]
    return ["frames", "number", *(f"{100 * level:.0f} % region" for level in _NAMED_LEVELS)], rows


def accuracy_text(result: dict) -> str:
    """Everything a terminal is shown."""
    parts = []
    for init, summary in result["summary"].get(DEFAULT, {}).items():
        parts.append(f"init {init}\n" + text_table(*object_table(summary, result["objects"]), left=2))
        parts.append("truth within the published Gaussian\n" + text_table(*coverage_table(summary["coverage"])))
        if summary["recovery"]:
            parts.append(recovery_text(summary["recovery"]))
    if len(result["variants"]) > 1:
        for init in result["config"]["inits"]:
            parts.append(f"variants, init {init}\n" + text_table(*comparison_table(result["comparison"], init)))
    parts.append(
        "final errors: particles (Eq. 3) mean, closest mode (Eq. 4) and published pose median over trials; "
        "right: converged, and within 10 mm"
    )
    return "\n\n".join(parts)
