"""Tables of where the filter ends, against the paper, peers and itself with parts off."""

from __future__ import annotations

import numpy as np

from midastouch_benchmark.statistics.comparison import pareto_front
from midastouch_benchmark.statistics.intervals import bootstrap_interval, share_interval
from midastouch_benchmark.trials.variants import DEFAULT, PRESET

from ..statistics.accuracy import final_errors, is_right, right_or_among_modes_at_end
from .cells import between, final_error, frames_cell, part_of, percent, pose_cell, share_cell
from .perception import depth_summary
from .reports import (
    COMMANDS,
    ENOUGH,
    NARROWER,
    PROTOCOLS,
    STARTS,
    UNMEASURED,
    Table,
    benchmark_summary,
    conditions_of,
    held_out,
    report,
    reported,
)


def paper() -> Table:
    """What the README shows."""
    known, unknown, bench = benchmark_summary("accuracy"), benchmark_summary("accuracy_uniform"), report("bench")
    step = bench["filter_ms"]
    rows = [
        [
            "final error of the particles, mean over ten objects, start as the paper's",
            final_error(known, "e", "mean"),
            "7.4 mm, 9.4 deg",
        ],
        [
            "final error of the closest mode, median over the same",
            final_error(known, "closest_mode", "median"),
            "2.8 mm, 2.0 deg",
        ],
        ["converged and within 10 mm at the end", part_of(known["right"], known["trials"]), "-"],
        ["the same, with nothing known at the start", part_of(unknown["right"], unknown["trials"]), "-"],
        [
            "depth network, RMSE on slides of another renderer",
            f"{depth_summary('evaluate_tdn')['rmse_mm']:.3f} mm",
            "0.135 mm",
        ],
        [
            "single touch: error of the 25 best matches, relative to random ones",
            f"{report('single_touch')['summary']['normalised_top25_error']:.3f}",
            "0.473",
        ],
        [
            "rate from image to estimate with 50k particles; once converged",
            f"{bench['end_to_end_hz']:.0f} Hz; {bench['converged_hz']:.0f} Hz on two CPU cores",
            "10 Hz on a GPU",
        ],
        [
            "filter step without fine stage, 50k; 1k particles",
            f"{step['50000']['p50']:.1f} ms; {step['1000']['p50']:.1f} ms",
            "-",
        ],
    ]
    return ["what", "this", "paper"], rows


def localisation() -> Table:
    """Ten objects, undisturbed and disturbed, and ten further ones."""
    rows = []
    for name, what in (STARTS | PROTOCOLS | held_out()).items():
        if name not in reported():
            continue
        one = benchmark_summary(name)
        few = one["trials"] < ENOUGH
        cells = [f"too few ({one['trials']})"] * 8 if few else _localisation(one, report(name)["trials"])
        rows.append([what, *cells, f"[{name}]"])
    rows.append(["*paper, start as above*", "7.4 mm, 9.4 deg", "2.8 mm, 2.0 deg", *["-"] * 7])
    header = [
        "conditions",
        "particles, mean",
        "closest mode, median",
        "right",
        "right, or `ambiguous` with the truth among the modes",
        "found 30 frames after the event, of those right before",
    ]
    header += ["frames until right again, median", "frames converged wrong", "truth in the 95 % region, converged"]
    return [*header, "report"], rows


def _localisation(one: dict, trials: list[dict]) -> list[str]:
    """Figures of a benchmark's summary with their intervals; reports of before 2026-11-22 have none."""
    errors = [final_error(one, "e", "mean"), final_error(one, "closest_mode", "median")]
    trust = one.get("trust")
    if trust is None:
        return [*errors, part_of(one["right"], one["trials"]), "-", "-", "-", percent(one["wrong_converged"], 1), "-"]
    event = trust["right_after_event"]["share"] is not None
    errors = [
        error if error == "-" else f"{error} ({between(trust[key][statistic]['interval'], '{:.1f}')} mm)"
        for error, key, statistic in zip(
            errors, ("e_trans_mm", "closest_mode_trans_mm"), ("mean", "median"), strict=True
        )
    ]
    return [
        *errors,
        share_cell(trust["right_at_end"]),
        share_cell(right_or_among_modes_at_end(trials)),
        f"{share_cell(trust['found_again'])} of {percent(trust['right_before_event']['share'])}" if event else "-",
        frames_cell(trust["frames_until_right"]["median"]) if event else "-",
        share_cell(trust["converged_wrong"], 1),
        share_cell(trust["region_95"]),
    ]


def widths() -> Table:
    """What a better guess at the start is worth; the paper's figure 8."""
    rows = []
    for name, beta in (NARROWER | {"accuracy": 1.0}).items():
        if name not in reported():
            continue
        one = benchmark_summary(name)
        initial, enough = one["initial"], one["trials"] >= ENOUGH
        cells = _localisation(one, report(name)["trials"])[:3] if enough else [f"too few ({one['trials']})"] * 3
        rows.append([f"{beta:g}", pose_cell(initial["e_trans_mm"], initial["e_rot_deg"]), *cells, f"[{name}]"])
    return ["beta", "particles at the start", "particles, mean", "closest mode, median", "right", "report"], rows


def areas() -> Table:
    """What a larger contact is worth, among the slides over the same object; the paper's figure 23."""
    trials = [trial for name in STARTS for trial in report(name)["trials"]]
    usual = {
        name: np.median([t["contact_area_mm2"] for t in trials if t["object"] == name])
        for name in {t["object"] for t in trials}
    }
    halves = {"smaller than usual on its object": [], "at least that": []}
    for t in trials:
        smaller, at_least = halves.values()
        (smaller if t["contact_area_mm2"] < usual[t["object"]] else at_least).append(t)
    sources = " ".join(f"[{name}]" for name in STARTS)
    rows = [[what, len(chosen), *_by_area(chosen), sources] for what, chosen in halves.items()]
    return ["contact of the slide", "trials", "its mean", "particles, mean", "right", "reports"], rows


def _by_area(trials: list[dict]) -> list[str]:
    if len(trials) < ENOUGH:
        return [f"too few ({len(trials)})"] * 3
    slides = [(t["object"], t["slide"]) for t in trials]
    area = np.mean([t["contact_area_mm2"] for t in trials])
    errors = final_errors(trials, "e_trans_mm")
    right = [is_right(t) for t in trials]
    share = {"share": np.mean(right), "interval": share_interval(right, [1] * len(right), slides)}
    error = f"{np.mean(errors):.1f} mm ({between(bootstrap_interval(errors, slides), '{:.1f}')})"
    return [f"{area:.0f} mm2", error, share_cell(share)]


def start() -> Table:
    """How soon there is a pose on an object that comes without a codebook."""
    header = ["first touches", "pose after, median", "longest", "median over an image of the paper's FCRN"]
    header += ["CPU time of the codebook and the filter on it, mean", "report"]
    if "start" not in reported():
        return header, [[UNMEASURED, *["-"] * 5]]
    one = report("start")["start"]
    first = one["first_pose_s"]
    cells = [f"too few ({one['trials']})"] * 4
    if one["enough"]:
        cells = [
            f"{first['value']:.1f} s ({between(first['interval'], '{:.1f}')})",
            f"{first['max']:.1f} s",
            f"{1e3 * first['value'] / report('bench')['fcrn_ms']['p50']:.0f}",
            f"{one['build_cpu_s']:.1f} s",
        ]
    return header, [[f"{one['trials']}, of {one['objects']} objects", *cells, "[start]"]]


def codebooks() -> Table:
    """What fewer poses cost, on the same slides."""
    header = ["poses", "right at the end", "paired difference", "particles, mean", "paired difference"]
    header += ["closest mode, median", "CPU a frame", "report"]
    if "codebooks" not in reported():
        return header, [[UNMEASURED, *["-"] * 7]]
    content, rows = report("codebooks"), []
    compared = {one["variant"]: one for one in content["comparison"]}
    for variant, poses in {"book_5k": "5,000", "book_10k": "10,000", DEFAULT: "50,000"}.items():
        one = compared[variant]
        cells = [f"too few ({one['trials']})"] * 6
        if one["trials"] >= ENOUGH:
            (summary,) = content["summary"][variant].values()
            right, error = (one[f"{what}_interval"] for what in ("right_difference", "difference_mm"))
            cells = [
                part_of(summary["right"], summary["trials"]),
                f"{one['right_difference']:+.0%} ({between(right, '{:+.0%}')})",
                final_error(summary, "e", "mean"),
                f"{one['difference_mm']:+.1f} mm ({between(error, '{:+.1f}')})",
                final_error(summary, "closest_mode", "median"),
                f"{one['cpu_ms_filter']:.1f} ms",
            ]
        rows.append([poses, *cells, "[codebooks]"])
    return header, rows


def peers() -> Table:
    """Other methods behind the same networks, on the same trials."""
    header = ["method", "trials", "published pose, median", "right", "frames converged wrong", "CPU a frame"]
    if "peers" not in reported():
        return header, [[UNMEASURED, *["-"] * 5]]
    content, rows = report("peers"), []
    for name, by_init in content["summary"].items():
        ((_, one),) = by_init.items()
        trust = one["trust"]
        cells = [f"too few ({one['trials']})"] * 4
        if trust["enough"]:
            error, cpu = trust["estimate_trans_mm"]["median"], trust["filter_cpu_ms"]["mean"]
            cells = [
                f"{final_error(one, 'estimate', 'median')} ({between(error['interval'], '{:.1f}')} mm)",
                share_cell(trust["right_at_end"]),
                share_cell(trust["converged_wrong"], 1),
                f"{cpu['value']:.1f} ms ({between(cpu['interval'], '{:.1f}')})",
            ]
        rows.append([content["variants"][name]["summary"], one["trials"], *cells])
    rows += [[name, "-", f"skipped: {why}", *["-"] * 3] for name, why in content["skipped_variants"].items()]
    return header, rows


def grasps() -> Table:
    """Grasps without sliding, by how many fingers touch."""
    figures = {
        "found": "closest mode found",
        "share": "probability at the true place",
        "right": "pose right",
        "converged": "converged",
        "converged_wrong": "converged wrong",
    }
    header = ["contacts", "after grasp", *figures.values(), "report"]
    if "grasp" not in reported():
        return header, [["*not measured yet*", *["-"] * (len(header) - 1)]]
    summary, rows = report("grasp")["summary"], []
    for contacts, variant in enumerate(("contact_1", "contacts_2", "contacts_3", "default"), 1):
        (by_grasp,) = (one["grasps"] for one in summary[variant].values())
        for number in (1, len(by_grasp)):
            one = by_grasp[number - 1]
            cells = [f"too few ({one['trials']})"] * len(figures)
            if one["trials"] >= ENOUGH:
                cells = [share_cell(one[key]) for key in figures]
            rows.append([contacts, number, *cells, "[grasp]"])
    return header, rows


def variants() -> Table:
    """What each part of the filter is worth, under the protocols that exercise it."""
    rows = []
    for name in (name for name in COMMANDS if name.startswith("ablation")):
        conditions = conditions_of(name)
        if name not in reported():
            rows.append([conditions, UNMEASURED, *["-"] * 5, f"`{name}`"])
            continue
        content = report(name)
        compared = content["comparison"]
        if (trials := compared[0]["trials"]) < ENOUGH:
            rows.append([conditions, f"{len(compared)} variants", *[f"too few ({trials})"] * 5, f"[{name}]"])
            continue
        for one in compared:
            rows.append([conditions, content["variants"][one["variant"]]["summary"], *_compared(one), f"[{name}]"])
    return ["conditions", "filter", *_COMPARED, "report"], rows


_COMPARED = (
    "particles, mean",
    "paired difference",
    "right",
    "frames converged wrong",
    "CPU a frame; against the default",
)


def _compared(one: dict) -> list[str]:
    """A variant against the default on the same trials."""
    return [
        pose_cell(one["e_trans_mm"], one["e_rot_deg"]),
        f"{one['difference_mm']:+.1f} mm ({between(one['difference_mm_interval'], '{:+.1f}')})",
        part_of(round(one["right"] * one["trials"]), one["trials"]),
        percent(one["wrong_converged"], 1),
        f"{one['cpu_ms_filter']:.1f} ms; {one['verdict']}",
    ]


def front() -> Table:
    """Run time against error: what can be had in more or less, fastest first, with the default and the presets."""
    header = ["filter", "nothing is both faster and more exact", *_COMPARED, "report"]
    if "front" not in reported():
        return header, [[UNMEASURED, *["-"] * 7]]
    content = report("front")
    compared = sorted(content["comparison"], key=lambda one: one["cpu_ms_filter"])
    if (trials := compared[0]["trials"]) < ENOUGH:
        return header, [[f"{len(compared)} variants", *[f"too few ({trials})"] * 6, "[front]"]]
    best = [one["variant"] for one in pareto_front(compared, "e_trans_mm")]
    rows = []
    for one in compared:
        about = content["variants"][one["variant"]]
        marked = about["group"] in (DEFAULT, PRESET)
        what = f"**{about['summary']}**" if marked else about["summary"]
        rows.append([what, "yes" if one["variant"] in best else "", *_compared(one), "[front]"])
    return header, rows


def slides() -> Table:
    """The slides of another renderer, which development used."""
    rows = []
    for name, start in (("evaluate_paper", "as the paper's"), ("evaluate_uniform", "nothing known")):
        for label, one in report(name)["summary"]["objects"].items():
            rows.append(
                [
                    label,
                    start,
                    final_error(one, "e", "mean"),
                    final_error(one, "closest_mode", "median"),
                    part_of(one["right"], one["trials"]),
                    f"{one['hz_mean']:.0f} Hz",
                    f"[{name}]",
                ]
            )
    return ["object", "start", "particles, mean", "closest mode, median", "right", "rate", "report"], rows
