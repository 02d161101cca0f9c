"""Figures of the accuracy over many trials: summaries per object, calibration, the terminal's tables."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import chi2

from midastouch_filter.state import CONVERGED

from .calibration import KINDS, LEVELS, WEIGHTS, observed_shares
from .comparison import comparison_table, front_text, rows_by_init, wrong_converged
from .grasps import grasp_summary, grasp_table
from .intervals import ENOUGH, bootstrap_interval, share_interval
from .summary import final_errors, is_right, summarise_trials
from .table import number, text_table
from .trial import AFTER_EVENT, STAGES
from .variants import DEFAULT, PAPER, PEER, VARIANTS

_NAMED_LEVELS = {level: int(np.argmin(np.abs(LEVELS - level))) for level in (0.5, 0.9, 0.95, 0.99)}
"""What tables show of `LEVELS`, and where it is there."""
_ERRORS = ("e", "closest_mode", "estimate")
_SUMMARISED = ("coverage", "reliability", "filter_stages_ms", "initial", "protocol")
_PAPER = {"particles": ("e", "mean", 7.4, 9.43), "closest mode": ("min_cluster", "median", 2.8, 2.03)}
"""The paper's final errors over its ten objects in simulation: metric, statistic, mm, deg."""


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


def trust(trials: list[dict]) -> dict:
    """What may be relied on, each figure with its 95 % interval: {"share" or "mean" or "median", "interval"}.

    converged_wrong, of all frames, and converged_frames_wrong, of the converged ones; right_at_end;
    right_modulo_symmetry_at_end; right_if_converged_at_end, of trials that end converged, and with ..._modulo_symmetry;
    regions, by kind of frame and level, share of frames whose region of that level holds the truth, and region_95, that
    of converged frames at 95 %; right_before_event, right_after_event, of trials, the latter so many frames later;
    found_again, of those that were right before; misled, of these too, which are ever converged at a wrong place, and
    misled_frames, in how many frames; frames_until_right, infinite where it never is again; final errors of particles,
    closest mode and published pose; ms of a frame, of which filter_cpu_ms; weights, by bin of `WEIGHTS`: frames, mean
    weight of the published mode, right, share of them whose pose is.
    enough: whether there are trials enough to claim anything.
    """
    groups = [(t["object"], t["slide"]) for t in trials]

    def shares(part: list[float], whole: list[float]) -> dict:
        total = float(np.sum(whole))
        return {
            "share": float(np.sum(part)) / total if total else None,
            "interval": share_interval(part, whole, groups),
        }

    def values(some: list[float]) -> dict:
        some = np.array(some, float)
        return {name: value(some, statistic) for name, statistic in (("mean", np.mean), ("median", np.median))}

    def value(some: np.ndarray, statistic: Callable) -> dict:
        known = some[~np.isnan(some)]
        return {
            "value": float(statistic(known)) if len(known) else None,
            "interval": bootstrap_interval(some, groups, statistic),
        }

    def regions(kind: str) -> dict:
        counts = np.array([t["coverage"][kind] for t in trials])
        within = np.cumsum(counts, axis=1)
        return {f"{level:g}": shares(within[:, k], counts.sum(axis=1)) for level, k in _NAMED_LEVELS.items()}

    ones = [1] * len(trials)
    converged = [t["frames_converged"] for t in trials]
    wrong = np.subtract(converged, [t["frames_converged_right"] for t in trials])
    ends_converged = [t["final"]["state"] == CONVERGED for t in trials]
    right = {key: [is_right(t, f"{key}estimate_trans_mm") for t in trials] for key in ("", "symmetric_")}
    asked = [t["right_after_event"] is not None for t in trials]
    before = [bool(t["right_before_event"]) for t in trials]
    after = [bool(t["right_after_event"]) for t in trials]
    out = {
        "trials": len(trials),
        "enough": len(trials) >= ENOUGH,
        "converged_wrong": shares(wrong, [t["frames"] for t in trials]),
        "converged_frames_wrong": shares(wrong, converged),
        "right_at_end": shares(right[""], ones),
        "right_modulo_symmetry_at_end": shares(right["symmetric_"], ones),
        "right_if_converged_at_end": shares(right[""], ends_converged),
        "right_if_converged_modulo_symmetry_at_end": shares(right["symmetric_"], ends_converged),
        "region_95": regions(CONVERGED)["0.95"],
        "regions": {kind: regions(kind) for kind in (CONVERGED, "right")},
        "right_before_event": shares(before, [t["right_before_event"] is not None for t in trials]),
        "right_after_event": shares(after, asked) | {"frames": AFTER_EVENT},
        "found_again": shares(np.logical_and(before, after), np.logical_and(before, asked)),
        "misled": shares(np.logical_and(before, wrong > 0), before),
        "misled_frames": values(np.where(before, wrong, np.nan)),
        "frames_until_right": {"median": value(np.array([_frames_until_right(t) for t in trials], float), np.median)},
        "ms": values([sum(t["ms"][stage] for stage in STAGES) for t in trials]),
        "filter_cpu_ms": values([t["filter_cpu_ms"] for t in trials]),
    }
    out["weights"] = []
    for k in range(len(WEIGHTS) + 1):
        frames, right, weight = ([t["reliability"][name][k] for t in trials] for name in ("frames", "right", "weight"))
        count = int(np.sum(frames))
        mean = float(np.sum(weight)) / count if count else None
        out["weights"].append({"frames": count, "mean_weight": mean, "right": shares(right, frames)})
    for prefix in _ERRORS:
        for unit in ("trans_mm", "rot_deg"):
            out[f"{prefix}_{unit}"] = values(final_errors(trials, f"{prefix}_{unit}"))
    return out


def _frames_until_right(trial: dict) -> float:
    """From the event to where it is right until the end; without an event from the start."""
    if trial["right_from_frame"] is None:
        return np.inf
    return max(trial["right_from_frame"] - (trial["event_at"] or 0), 0)


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
    frames = [_frames_until_right(t) for t in disturbed if t["right_from_frame"] is not None]
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
    return f"right again in {back['recovered']} of {back['trials']} trials after the event{after}"


def trust_table(trust: dict) -> tuple[list[str], list[list[object]]]:
    """Header and rows of `trust`: what, figure, 95 % interval; in place of figures "too few" below `ENOUGH` trials."""
    after = trust["right_after_event"]["frames"]
    percent = {
        "converged_wrong": "frames converged wrong",
        "right_at_end": "right at the end",
        "right_modulo_symmetry_at_end": "right at the end, modulo symmetry",
        "right_before_event": "right before the event",
        "right_after_event": f"right {after} frames after the event",
        "found_again": "the same, of those right before",
        "misled": "ever converged wrong, of those right before",
        "converged_frames_wrong": "converged frames that are wrong",
        "right_if_converged_at_end": "right, of trials that end converged",
        "right_if_converged_modulo_symmetry_at_end": "the same, modulo symmetry",
        "region_95": "converged frames whose 95 % region holds the truth",
    }
    plain = {
        ("frames_until_right", "median"): "frames until right, median",
        ("e_trans_mm", "mean"): "particles mm, mean",
        ("e_rot_deg", "mean"): "particles deg, mean",
        ("closest_mode_trans_mm", "median"): "closest mode mm, median",
        ("closest_mode_rot_deg", "median"): "closest mode deg, median",
        ("filter_cpu_ms", "mean"): "CPU ms of the filter a frame, mean",
    }
    rows = [
        [label, *_figure(one["share"], one["interval"], "{:.1%}")]
        for label, one in ((label, trust[key]) for key, label in percent.items())
    ]
    rows += [
        [label, *_figure(one["value"], one["interval"], "{:.1f}")]
        for label, one in ((label, trust[key][statistic]) for (key, statistic), label in plain.items())
    ]
    if not trust["enough"]:
        rows = [[label, f"too few ({trust['trials']})", ""] for label, *_ in rows]
    return [f"over {trust['trials']} trials", "figure", "95 % interval"], rows


def _figure(value: float | None, interval: list[float] | None, form: str) -> tuple[str, str]:
    def one(value: float | None) -> str:
        return "never" if value is None or np.isinf(value) else form.format(value)

    if value is None and interval is None:
        return "-", "-"
    return one(value), "-" if interval is None else " ... ".join(map(one, interval))


def peers_of(summary: dict[str, dict], init: str) -> dict[str, dict]:
    """Summaries of one init of the default and of other methods, by name."""
    return {name: by_init[init] for name, by_init in summary.items() if "trust" in by_init.get(init, {})}


def peer_table(summaries: dict[str, dict]) -> tuple[list[str], list[list[object]]]:
    """Header and rows of `trust` of several methods, by their names, each figure with its 95 % interval."""
    columns = {
        "pose mm, median": ("estimate_trans_mm", "median", "{:.1f}"),
        "deg, median": ("estimate_rot_deg", "median", "{:.1f}"),
        "right at the end": ("right_at_end", None, "{:.0%}"),
        "frames converged wrong": ("converged_wrong", None, "{:.1%}"),
        "CPU ms a frame, mean": ("filter_cpu_ms", "mean", "{:.1f}"),
    }
    rows = []
    for name, summary in summaries.items():
        trust = summary["trust"]
        cells = [f"too few ({trust['trials']})"] * len(columns)
        if trust["enough"]:
            figures = [(trust[key][statistic] if statistic else trust[key], form) for key, statistic, form in
                       columns.values()]  # fmt: skip
            shown = [_figure(one.get("share", one.get("value")), one["interval"], form) for one, form in figures]
            cells = [f"{value} ({interval})" for value, interval in shown]
        rows.append([name, trust["trials"], *cells])
    return ["method", "trials", *columns], rows


def share(part: int, whole: int) -> str:
    """`part` of `whole` in percent."""
    return f"{100 * part / whole:.0f} %"


def _pair(one: dict, prefix: str, statistic: str) -> list[str]:
    return [number(one.get(f"{prefix}_{unit}", {}).get(statistic)) for unit in ("trans_mm", "rot_deg")]


def coverage_table(levels: dict[str, dict]) -> tuple[list[str], list[list[object]]]:
    """Header and rows: by kind of frame, the share of frames whose truth lies within the 50, 90, 95, 99 % region, and
    the median of the normalised error squared."""
    rows = []
    for kind, one in levels.items():
        shares = [f"{100 * one['observed'][k]:.0f} %" if one["frames"] else "-" for k in _NAMED_LEVELS.values()]
        beyond = f"> {chi2.ppf(LEVELS[-1], 6):.0f}" if one["frames"] else "-"
        nees = beyond if one["median_nees"] is None else number(one["median_nees"])
        rows.append([kind.replace("_", " "), one["frames"], *shares, nees])
    regions = [f"{100 * level:.0f} % region" for level in _NAMED_LEVELS]
    return ["frames", "number", *regions, f"median NEES (calibrated: {chi2.median(6):.1f})"], rows


def weight_table(trust: dict) -> tuple[list[str], list[list[object]]]:
    """Header and rows: how often a published pose is right, by the weight of its mode."""
    rows = [
        [
            f"{one['mean_weight']:.0%}",
            one["frames"],
            *_figure(one["right"]["share"], one["right"]["interval"], "{:.0%}"),
        ]
        for one in trust["weights"]
        if one["frames"]
    ]
    return ["weight of the published mode", "frames", "right", "95 % interval"], rows


def accuracy_text(result: dict) -> str:
    """Everything a terminal is shown."""
    parts = []
    for init, summary in result["summary"].get(DEFAULT, {}).items():
        parts.append(f"init {init}\n" + text_table(*object_table(summary, result["objects"]), left=2))
        if init == "paper":
            parts.append(paper_text(summary))
        parts.append(text_table(*trust_table(summary["trust"])))
        parts.append("truth within the published Gaussian\n" + text_table(*coverage_table(summary["coverage"])))
        parts.append(text_table(*weight_table(summary["trust"])))
        if summary["recovery"]:
            parts.append(recovery_text(summary["recovery"]))
        if summary["grasps"]:
            grasps = {name: by_init[init]["grasps"] for name, by_init in result["summary"].items()}
            parts.append(text_table(*grasp_table(grasps, result["variants"])))
        if len(peers := peers_of(result["summary"], init)) > 1:
            parts.append("methods on the same slides\n" + text_table(*peer_table(peers)))
    for init, rows in rows_by_init(result["comparison"]).items():
        if len(rows) > 1:
            table = text_table(*comparison_table(rows, result["variants"]))
            parts.append(f"variants, init {init}, all on the same trials\n{table}\n{front_text(rows)}")
    parts.append(
        "final errors: particles (Eq. 3) mean, closest mode (Eq. 4) and published pose median over trials; "
        "modulo symmetry: of the equivalent pose nearest to the truth; right: converged, and within 10 mm"
    )
    return "\n\n".join(parts)
