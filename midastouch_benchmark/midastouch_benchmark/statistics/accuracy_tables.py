"""Tables of the accuracy over many trials, for the terminal and the report's page."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from midastouch_bringup.text_table import number, text_table

from ..trials.grasps import grasp_table
from ..trials.variants import DEFAULT
from .accuracy import SHOWN_LEVELS
from .comparison import comparison_table, front_text, rows_by_init
from .coverage import LEVELS

_PAPER = {"particles": ("e", "mean", 7.4, 9.43), "closest mode": ("min_cluster", "median", 2.8, 2.03)}
"""The paper's final errors over its ten objects in simulation: metric, statistic, mm, deg."""


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
        "right_or_among_modes_at_end": "right at the end, or ambiguous with the truth among the modes",
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
    # results of before 2026-11-23 do not have all
    shares = ((label, trust[key]) for key, label in percent.items() if key in trust)
    rows = [[label, *_figure(one["share"], one["interval"], "{:.1%}")] for label, one in shares]
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
        shares = [f"{100 * one['observed'][k]:.0f} %" if one["frames"] else "-" for k in SHOWN_LEVELS.values()]
        beyond = f"> {chi2.ppf(LEVELS[-1], 6):.0f}" if one["frames"] else "-"
        nees = beyond if one["median_nees"] is None else number(one["median_nees"])
        rows.append([kind.replace("_", " "), one["frames"], *shares, nees])
    regions = [f"{100 * level:.0f} % region" for level in SHOWN_LEVELS]
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
