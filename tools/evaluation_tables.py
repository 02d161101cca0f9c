"""The tables of README.md, docs/evaluation.md and docs/trust.md from the committed reports.

.venv/bin/python tools/evaluation_tables.py

A table stands between `<!-- table NAME -->` and `<!-- end -->`; only that is rewritten. Of a report that was made
several times the newest counts: `reports/<date>/NAME.json`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from midastouch_bringup.evaluation.calibration import WEIGHTS
from midastouch_bringup.evaluation.exploration_summary import summarise_exploration
from midastouch_bringup.evaluation.paired import error_ratio
from midastouch_bringup.evaluation.variants import DEFAULT
from midastouch_filter.config import FilterConfig

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = ("README.md", "docs/evaluation.md", "docs/trust.md")

_BENCHMARK = "midastouch benchmark --meshes ../shared/meshes/ycb"
_REAL = "--init paper --slides 2 --seeds 5 --stride 2 --sensor digit_real --codebook-size 10000"
_SLIDES = "../shared/data/ycb_slide_sim"
_LOAD = ".venv/bin/python -m pytest midastouch_bringup/test/soak/test_load.py -k sensors_rate"
_TEN = "../shared/meshes/ycb/{004,005,006,021,025,035,037,042,048,055}_*.ply"
PROTOCOLS = {
    "tool_bias": "tool 2 mm, 2 deg off",
    "late": "poses 50 ms late",
    "slow_camera": "every image comes twice",
    "rest": "at rest in contact for 20 s",
    "lift": "lifted 20 mm, put down 50 mm away",
    "kidnap": "lifted; the object is moved by 50 mm, untold",
    "jump": "30 mm, 175 deg in one step",
    "unexplained": "12 touches that nothing explains",
    "push": "the object is pushed by 5 mm, 5 deg",
    "wrong_mesh": "another object is touched (always wrong)",
    "small_parts": "parts smaller than the gel, twins counted",
}
_MANY = "--slides 10 --seeds 2"
COMMANDS = {
    "accuracy": f"{_BENCHMARK} --init paper --seeds 4 --jobs 2",
    "accuracy_uniform": f"{_BENCHMARK} --init uniform --seeds 4 --jobs 2 --minutes 12",
    **{name: f"{_BENCHMARK} --protocol {name} {_MANY}" for name in PROTOCOLS},
    **{
        f"{name}_held_out": f"{_BENCHMARK} --objects held_out --protocol {name} --slides 10 --seeds 1"
        for name in ("plain", "uniform", *PROTOCOLS)
        if name != "small_parts"
    },
    "identify": "midastouch identify --meshes ../shared/meshes/ycb --slides 10",
    "identify_all": "midastouch identify --meshes ../shared/meshes/ycb --objects all --slides 2 --codebook-size 10000",
    "start": "midastouch evaluate-start --meshes ../shared/meshes/ycb --slides 10",
    "codebooks": f"{_BENCHMARK} --init uniform --length 0.3 --slides 10 --seeds 1 --variant book_5k book_10k",
    "peers": f"{_BENCHMARK} --length 0.3 --slides 10 --seeds 1 --variant peers",
    "grasp": f"{_BENCHMARK} --protocol grasp --variant contacts --slides 10 --seeds 1",
    "real_plain": f"{_BENCHMARK} {_REAL}",
    "real_sensor": f"{_BENCHMARK} {_REAL} --protocol real_sensor",
    "real_sensor_calibrated": f"{_BENCHMARK} {_REAL} --protocol real_sensor_calibrated",
    "ablation": f"{_BENCHMARK} --length 0.3 --slides 10 --seeds 1 --variant paper ablation",
    "ablation_rest": f"{_BENCHMARK} --protocol rest --slides 10 --seeds 1 --variant gates",
    "ablation_slow_camera": f"{_BENCHMARK} --protocol slow_camera --slides 10 --seeds 1 --variant gates",
    "ablation_kidnap": f"{_BENCHMARK} --protocol kidnap {_MANY} --variant no_recovery",
    "ablation_codes": f"{_BENCHMARK} --protocol kidnap --slides 10 --seeds 1 --variant no_refinement codes_no_recovery",
    "ablation_tool_bias": f"{_BENCHMARK} --protocol tool_bias --slides 10 --seeds 1 --variant no_arm_errors",
    "ablation_push": f"{_BENCHMARK} --protocol push --slides 10 --seeds 1 --variant no_object_motion",
    "evaluate_paper": f"midastouch evaluate {_SLIDES}/*/00 --seeds 10 --init paper",
    "evaluate_uniform": f"midastouch evaluate {_SLIDES}/035_power_drill/00 --seeds 5 --init uniform",
    "evaluate_tdn": f"midastouch evaluate-tdn {_SLIDES}/*/00",
    "evaluate_tdn_held_out": "midastouch evaluate-tdn out/held_out/*",
    "presses_d20641": "midastouch evaluate-presses ../shared/data/digit_real/sphere_presses_d20641 "
    "--ball-diameter 0.0088 --px-per-mm 18.68 --check-labels",
    "presses_d20641_calibrated": "midastouch evaluate-presses ../shared/data/digit_real/sphere_presses_d20641 "
    "--ball-diameter 0.0088 --px-per-mm 18.68 --calibrate-with 10 --check-labels",
    "presses_vocdex": "midastouch evaluate-presses ../shared/data/digit_real/sphere_presses_vocdex "
    "--ball-diameter 0.006 --check-labels",
    "presses_vocdex_calibrated": "midastouch evaluate-presses ../shared/data/digit_real/sphere_presses_vocdex "
    "--ball-diameter 0.006 --calibrate-with 10 --check-labels",
    "checks": "midastouch evaluate-checks ../shared/data/digit_backgrounds --sensors 100 "
    "--colour-table ../shared/data/digit_real/taxim_digit/polycalib.npz "
    "--presses ../shared/data/digit_real/ball_presses ../shared/data/digit_real/sphere_presses_d20641 "
    "../shared/data/digit_real/sphere_presses_vocdex",
    "single_touch": f"midastouch single-touch {_TEN} --queries 2000",
    "single_touch_random": f"midastouch single-touch {_TEN} --queries 500 --lighting random "
    "--backgrounds ../shared/data/digit_backgrounds --baseline-size 0",
    "exploration": "midastouch evaluate-exploration --meshes ../shared/meshes/ycb --trials 10 "
    "--policy suggested random",
    "twins": "midastouch evaluate-exploration --meshes ../shared/meshes/ycb --objects 021 025 --trials 50 "
    "--policy suggested",
    "bench": "midastouch bench --paper-networks",
    "soak": "make soak MINUTES=1",
    "load_eyebolt": f"SOAK_MINUTES=10 {_LOAD}",
    "load_mug": f"SOAK_MINUTES=5 SOAK_MESH=../shared/meshes/ycb/025_mug.ply {_LOAD}",
}
_WEIGHED = {"accuracy": "start as the paper's", "tool_bias": "tool off", "kidnap": "moved untold"}
ENOUGH = 100
"""Fewer trials than this claim nothing."""
UNMEASURED = "*not measured yet*"
STARTS = {"accuracy": "start as the paper's", "accuracy_uniform": "nothing known at the start"}
EVENTS = ("rest", "lift", "kidnap", "jump", "unexplained", "push")
"""Protocols in which something happens on the way."""
PROMISED_WRONG, PROMISED_REGION = 1 - FilterConfig().converged_probability, 0.95
"""What is promised: at most so many of the converged frames are wrong, and the 95 % region holds the truth."""
OPTICS = {
    "real_plain": "TACTO's",
    "real_sensor": "of two real sensors, not calibrated",
    "real_sensor_calibrated": "of the same, calibrated with ten presses each",
}

Table = tuple[list[str], list[list[object]]]


def report_path(name: str) -> Path:
    """The newest report of that name."""
    found = sorted((ROOT / "reports").glob(f"*/{name}.json"))
    if not found:
        raise FileNotFoundError(f"no reports/*/{name}.json, made by: {COMMANDS[name]}")
    return found[-1]


def reported() -> list[str]:
    """Names of the reports that there are."""
    return [name for name in COMMANDS if any((ROOT / "reports").glob(f"*/{name}.json"))]


def report(name: str) -> dict:
    """Its content."""
    return json.loads(report_path(name).read_text())


def _pose(millimetres: float, degrees: float) -> str:
    return f"{millimetres:.1f} mm, {degrees:.1f} deg"


def _error(summary: dict, prefix: str, statistic: str) -> str:
    """A final error over all trials of a summary: `e` of the particles, `closest_mode`, `estimate`."""
    millimetres, degrees = (summary[f"{prefix}_{unit}"].get(statistic) for unit in ("trans_mm", "rot_deg"))
    return "-" if millimetres is None else _pose(millimetres, degrees)


def _of(part: int, whole: int) -> str:
    return f"{part} of {whole}"


def _percent(share: float, digits: int = 0) -> str:
    return f"{100 * share:.{digits}f} %"


def benchmark_summary(name: str) -> dict:
    """Summary of a benchmark of the filter as shipped, in its only way to start."""
    (summary,) = report(name)["summary"]["default"].values()
    return summary


def paper() -> Table:
    """What the README shows."""
    known, unknown, bench = benchmark_summary("accuracy"), benchmark_summary("accuracy_uniform"), report("bench")
    step = bench["filter_ms"]
    rows = [
        [
            "final error of the particles, mean over ten objects, start as the paper's",
            _error(known, "e", "mean"),
            "7.4 mm, 9.4 deg",
        ],
        [
            "final error of the closest mode, median over the same",
            _error(known, "closest_mode", "median"),
            "2.8 mm, 2.0 deg",
        ],
        ["converged and within 10 mm at the end", _of(known["right"], known["trials"]), "-"],
        ["the same, with nothing known at the start", _of(unknown["right"], unknown["trials"]), "-"],
        [
            "depth network, RMSE on slides of another renderer",
            f"{_depth('evaluate_tdn')['rmse_mm']:.3f} mm",
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
    for name, what in (STARTS | PROTOCOLS | _held_out()).items():
        if name not in reported():
            continue
        one = benchmark_summary(name)
        cells = [f"too few ({one['trials']})"] * 7 if one["trials"] < ENOUGH else _localisation(one)
        rows.append([what, *cells, f"[{name}]"])
    rows.append(["*paper, start as above*", "7.4 mm, 9.4 deg", "2.8 mm, 2.0 deg", *["-"] * 6])
    header = [
        "conditions",
        "particles, mean",
        "closest mode, median",
        "right",
        "found 30 frames after the event, of those right before",
    ]
    header += ["frames until right again, median", "frames converged wrong", "truth in the 95 % region, converged"]
    return [*header, "report"], rows


def _held_out() -> dict[str, str]:
    """The same conditions over ten further objects, by the names of the reports."""
    further = {"plain": STARTS["accuracy"], "uniform": STARTS["accuracy_uniform"]} | PROTOCOLS
    return {f"{name}_held_out": f"{what}; ten further objects" for name, what in further.items()}


def _localisation(one: dict) -> list[str]:
    """Figures of a benchmark's summary with their intervals; reports of before 2026-11-22 have none."""
    errors = [_error(one, "e", "mean"), _error(one, "closest_mode", "median")]
    trust = one.get("trust")
    if trust is None:
        return [*errors, _of(one["right"], one["trials"]), "-", "-", _percent(one["wrong_converged"], 1), "-"]
    event = trust["right_after_event"]["share"] is not None
    errors = [
        error if error == "-" else f"{error} ({_between(trust[key][statistic]['interval'], '{:.1f}')} mm)"
        for error, key, statistic in zip(
            errors, ("e_trans_mm", "closest_mode_trans_mm"), ("mean", "median"), strict=True
        )
    ]
    return [
        *errors,
        _share(trust["right_at_end"]),
        f"{_share(trust['found_again'])} of {_percent(trust['right_before_event']['share'])}" if event else "-",
        _frames(trust["frames_until_right"]["median"]) if event else "-",
        _share(trust["converged_wrong"], 1),
        _share(trust["region_95"]),
    ]


def _share(one: dict, digits: int = 0) -> str:
    if one["share"] is None:
        return "-"
    return f"{_percent(one['share'], digits)} ({_between(one['interval'], f'{{:.{digits}%}}')})"


def _between(interval: list[float] | None, form: str) -> str:
    return "-" if interval is None else "...".join("never" if one is None else form.format(one) for one in interval)


def conditions() -> dict[str, str]:
    """What trust is asked of: every protocol, and over ten further objects and real optics what there is."""
    optics = {name: f"light {what}" for name, what in OPTICS.items() if name != "real_plain"}
    there = {name: what for name, what in (_held_out() | optics).items() if trusted(name)}
    return STARTS | PROTOCOLS | there


def trusted(name: str) -> dict | None:
    """What a report says of trust; None where there is none, or none with intervals (before 2026-11-22)."""
    one = benchmark_summary(name).get("trust") if name in reported() else None
    if one and "regions" not in one:
        mend = "run its command again; with the same --out it takes seconds"
        raise KeyError(f"{report_path(name).relative_to(ROOT)}: has no regions; {mend}")
    return one


def _trust_rows(names: dict[str, str], cells: Callable[[dict], list[str]], width: int) -> list[list[object]]:
    """One row for each report: what, cells of its trust, link."""
    rows = []
    for name, what in names.items():
        if (one := trusted(name)) is None:
            rows.append([what, UNMEASURED, *["-"] * width])
        else:
            few = [f"too few ({one['trials']})"] * width
            rows.append([what, *(cells(one) if one["trials"] >= ENOUGH else few), f"[{name}]"])
    return rows


def converged() -> Table:
    """How often the state `converged` is right."""

    def cells(one: dict) -> list[str]:
        wrong = one["converged_frames_wrong"]
        keys = ("right_if_converged_at_end", "right_if_converged_modulo_symmetry_at_end")
        words = ("kept", "*not kept*", "not shown")
        return [_share(wrong, 1), _verdict(wrong, PROMISED_WRONG, *words), *(_share(one[key]) for key in keys)]

    header = ["conditions", "of converged frames, wrong", f"at most {_percent(PROMISED_WRONG)}"]
    header += ["of trials that end `converged`, right", "the same, counting a symmetric twin as right", "report"]
    return header, _trust_rows(conditions(), cells, 4)


def weights() -> Table:
    """How often a published pose is right, by the weight of its mode."""
    shown = {name: benchmark_summary(name)["trust"] for name in _WEIGHED if name in reported()}
    shown = {name: trust["weights"] for name, trust in shown.items() if trust["enough"] and "weights" in trust}
    rows = []
    for k, (low, high) in enumerate(pairwise([0.0, *WEIGHTS, 1.0])):
        bins = [weights[k] for weights in shown.values()]
        rows.append([f"{low:.0%} to {high:.0%}", *(_share(one["right"]) if one["frames"] else "-" for one in bins)])
    return ["weight of the published mode", *(f"right, {_WEIGHED[name]}" for name in shown)], rows


def regions() -> Table:
    """How often the published covariance holds the truth."""

    def cells(one: dict) -> list[str]:
        sure, right = (one["regions"][kind] for kind in ("converged", "right"))
        verdict = _verdict(sure["0.95"], PROMISED_REGION, "*too small*", "too large", "as said")
        return [*map(_share, sure.values()), verdict, *map(_share, right.values())]

    levels = ("50 %", "90 %", "95 %", "99 %")
    header = ["conditions", *(f"{level}, `converged`" for level in levels), "95 % region of `converged` frames"]
    return [*header, *(f"{level}, right" for level in levels), "report"], _trust_rows(conditions(), cells, 9)


def events() -> Table:
    """How long it takes until something that happened is noticed, and until the filter is right again."""

    def cells(one: dict) -> list[str]:
        frames, until = one["misled_frames"]["mean"], one["frames_until_right"]["median"]
        misled = "-" if frames["value"] is None else f"{frames['value']:.1f} ({_between(frames['interval'], '{:.1f}')})"
        shares = [_share(one[key]) for key in ("right_before_event", "misled")]
        return [*shares, misled, _share(one["found_again"]), _frames(until)]

    header = ["event", "right before it", "of these, ever `converged` at a wrong place", "in how many frames, mean"]
    header += ["of these, right again after 30 frames", "frames until right again, median", "report"]
    return header, _trust_rows({name: PROTOCOLS[name] for name in EVENTS}, cells, 5)


def _verdict(one: dict, limit: float, below: str, above: str, undecided: str) -> str:
    """Which side of a limit a share is on, by its whole interval."""
    if one["interval"] is None:
        return "-"
    low, high = one["interval"]
    return below if high <= limit else above if low > limit else undecided


def _frames(one: dict) -> str:
    """Frames with their interval; none in the report: infinitely many."""
    value = "never" if one["value"] is None else f"{one['value']:.0f}"
    return f"{value} ({_between(one['interval'], '{:.0f}')})"


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
            f"{first['value']:.1f} s ({_between(first['interval'], '{:.1f}')})",
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
                _of(summary["right"], summary["trials"]),
                f"{one['right_difference']:+.0%} ({_between(right, '{:+.0%}')})",
                _error(summary, "e", "mean"),
                f"{one['difference_mm']:+.1f} mm ({_between(error, '{:+.1f}')})",
                _error(summary, "closest_mode", "median"),
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
                f"{_error(one, 'estimate', 'median')} ({_between(error['interval'], '{:.1f}')} mm)",
                _share(trust["right_at_end"]),
                _share(trust["converged_wrong"], 1),
                f"{cpu['value']:.1f} ms ({_between(cpu['interval'], '{:.1f}')})",
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
                cells = [_share(one[key]) for key in figures]
            rows.append([contacts, number, *cells, "[grasp]"])
    return header, rows


def identification() -> Table:
    """Which object of a catalogue it is."""
    header = ["catalogue", "slides", "right at the end", "pose right, too", "pose, object known"]
    header += ["refused, when left out", "path until right, median", "expected calibration error"]
    header += ["CPU a frame, over one known object's", "report"]
    rows = []
    for name, what in (("identify", "the ten"), ("identify_all", "all 78 of YCB")):
        if name not in reported():
            rows.append([what, *["*not measured yet*"] * 8, "-"])
            continue
        one = report(name)["identification"]
        cells = [f"too few ({one['known']})"] * 7
        if one["enough"]:
            path, ratio = one["path_until_right"], one["cpu_ratio"]
            until = "never" if path["value"] is None else f"{path['value']:.2f} m"
            cells = [
                *(_share(one[key]) for key in ("right", "pose_right", "alone_pose_right", "refused")),
                f"{until} ({_between(path['interval'], '{:.2f}')})",
                f"{one['calibration_error']:.3f}",
                f"{ratio['value']:.2f} ({_between(ratio['interval'], '{:.2f}')})",
            ]
        rows.append([what, f"{one['known']} with, {one['unknown']} without", *cells, f"[{name}]"])
    return header, rows


def exploration() -> Table:
    """A finger that is told where to touch next, against one that goes anywhere."""
    header = ["finger goes", "trials", "converged right", "converged wrong", "said alike", "path until right, median"]
    header += ["over that of random", "answers within, CPU", "report"]
    if "exploration" not in reported():
        return header, [[UNMEASURED, *["-"] * 8]]
    content, rows = report("exploration"), []
    for name, one in summarise_exploration(content["trials"]).items():
        cells = [f"too few ({one['trials']})"] * 6
        if one["enough"]:
            path, ratio, asked = one["path_m"], one["path_ratio"], one["asked_ms"]
            cells = [_share(one[key]) for key in ("right", "wrong", "alike")]
            cells += [f"{_millimetres(path['value'])} mm ({_millimetres_between(path['interval'])})"]
            cells += ["-" if ratio is None else f"{ratio:.2f}", "-" if asked is None else f"{asked:.0f} ms"]
        rows.append([content["config"]["policies"][name], one["trials"], *cells, "[exploration]"])
    return header, rows


def _millimetres(path: float) -> str:
    return "never" if math.isinf(path) else f"{1e3 * path:.0f}"


def _millimetres_between(interval: list[float] | None) -> str:
    return "-" if interval is None else "...".join(map(_millimetres, interval))


def twins() -> Table:
    """Places that feel alike but for what lies elsewhere: are they told apart, or is it said that they cannot be?"""
    header = ["objects", "trials", "another place competed", "of these told apart", "of these said alike"]
    header += ["converged wrong", "path until right, median", "report"]
    if "twins" not in reported():
        return header, [[UNMEASURED, *["-"] * 7]]
    (one,) = summarise_exploration(report("twins")["trials"]).values()
    cells = [f"too few ({one['trials']})"] * 5
    if one["enough"]:
        cells = [_share(one[key]) for key in ("rivalled", "told_apart", "said_alike", "wrong")]
        cells.append(f"{_millimetres(one['path_m']['value'])} mm ({_millimetres_between(one['path_m']['interval'])})")
    return header, [[", ".join(one["objects"]), one["trials"], *cells, "[twins]"]]


def real() -> Table:
    """Ten objects through the optics of measured sensors, against TACTO's on the same slides."""
    header = ["optics", "particles, mean", "closest mode, median", "right", "mean error over TACTO's"]
    header += ["median of pairs", "report"]
    rows = []
    for name, what in OPTICS.items():
        if name not in reported():
            rows.append([what, *[UNMEASURED] * 5, "-"])
            continue
        one = benchmark_summary(name)
        cells = [f"too few ({one['trials']})"] * 5
        if one["trials"] >= ENOUGH:
            ratio = error_ratio(report(name)["trials"], report("real_plain")["trials"])
            cells = [
                _error(one, "e", "mean"),
                _error(one, "closest_mode", "median"),
                _share(one["trust"]["right_at_end"]),
                f"{ratio.value:.2f} ({ratio.low:.2f}...{ratio.high:.2f})",
                f"{ratio.median:.2f}",
            ]
        rows.append([what, *cells, f"[{name}]"])
    return header, rows


def variants() -> Table:
    """What each part of the filter is worth, under the protocols that exercise it."""
    rows = []
    for name in (name for name in reported() if name.startswith("ablation")):
        content = report(name)
        compared = content["comparison"]
        if (trials := compared[0]["trials"]) < ENOUGH:
            rows.append([f"{len(compared)} variants", *[f"too few ({trials})"] * 5, f"[{name}]"])
            continue
        for one in compared:
            difference = _between(one["difference_mm_interval"], "{:+.1f}")
            cells = [
                _pose(one["e_trans_mm"], one["e_rot_deg"]),
                f"{one['difference_mm']:+.1f} mm ({difference})",
                _of(round(one["right"] * one["trials"]), one["trials"]),
                _percent(one["wrong_converged"], 1),
                f"{one['cpu_ms_filter']:.1f} ms; {one['verdict']}",
            ]
            rows.append([content["variants"][one["variant"]]["summary"], *cells, f"[{name}]"])
    header = ["filter", "particles, mean", "paired difference", "right", "frames converged wrong"]
    return [*header, "CPU a frame; against the default", "report"], rows


def slides() -> Table:
    """The slides of another renderer, which development used."""
    rows = []
    for name, start in (("evaluate_paper", "as the paper's"), ("evaluate_uniform", "nothing known")):
        for label, one in report(name)["summary"]["objects"].items():
            rows.append(
                [
                    label,
                    start,
                    _error(one, "e", "mean"),
                    _error(one, "closest_mode", "median"),
                    _of(one["right"], one["trials"]),
                    f"{one['hz_mean']:.0f} Hz",
                    f"[{name}]",
                ]
            )
    return ["object", "start", "particles, mean", "closest mode, median", "right", "rate", "report"], rows


def _depth(name: str) -> dict:
    return report(name)["summary"]


def depth() -> Table:
    """The depth network where the truth is known."""
    labels = {
        "evaluate_tdn": "three slides of another renderer",
        "evaluate_tdn_held_out": "our slides over seven scans that only validate",
    }
    rows = [
        [
            label,
            f"{_depth(name)['rmse_mm']:.3f} mm",
            f"{_depth(name)['contact_rmse_mm']:.3f} mm",
            f"{_depth(name)['contact_iou']:.3f}",
            f"[{name}]",
        ]
        for name, label in labels.items()
    ]
    rows.append(["*paper*", "0.135 mm", "-", "-", "-"])
    return ["slides", "RMSE, all pixels", "in contact", "contact IoU", "report"], rows


def labels() -> Table:
    """The same presses without the labels, and the labels themselves."""
    rows = []
    for sensor in ("d20641", "vocdex"):
        plain, calibrated = (report(f"presses_{sensor}{how}") for how in ("", "_calibrated"))
        for what, content, key in (
            ("labels against images", plain, "labels"),
            ("felt without calibration, against images", plain, "against_fit"),
            ("felt with calibration, against images", calibrated, "against_fit"),
        ):
            cells = [UNMEASURED] * 4
            if one := content.get(key):
                cells = [f"{one['rmse_in_circle_mm']:.2f} mm", f"{one['peak_ratio']:.2f}"]
                cells += [f"{one['depth_correlation']:.2f}", f"{one['centre_mm']:.2f} mm"]
            rows.append([f"{1e3 * plain['ball_diameter']:.1f} mm", what, *cells])
    return ["ball", "what", "RMSE inside", "deepest over deepest", "correlation of both", "centres apart"], rows


def presses() -> Table:
    """The depth network on two real sensors, against the ball under the labelled outline."""
    rows = []
    for name in ("presses_d20641", "presses_d20641_calibrated", "presses_vocdex", "presses_vocdex_calibrated"):
        content = report(name)
        one = content["summary"]
        rows.append(
            [
                f"{1e3 * content['ball_diameter']:.1f} mm, {one['presses']} times",
                f"with {content['calibrated_with']} others" if content["calibrated_with"] else "without",
                f"{one['rmse_in_circle_mm']:.2f} mm",
                f"{one['peak_ratio']:.2f}",
                f"{one['depth_correlation']:.2f}",
                f"{one['felt_radius_mm']:.1f} mm",
                f"{one['iou']:.2f}",
                f"[{name}]",
            ]
        )
    header = ["ball", "calibration", "RMSE inside", "deepest felt over deepest of the ball", "correlation of both"]
    return [*header, "radius felt", "IoU", "report"], rows


def checks() -> Table:
    """False and missed alarms."""
    content = report("checks")
    rows = [[what, _percent(one["alarms"])] for what, one in content["fit_check"].items()]
    rows[0][0] = "all as it should be (false alarms)"
    layouts = [[f"no-contact image {what}", _percent(share)] for what, share in content["no_contact_image"].items()]
    layouts[0][0] = "no-contact image as it should be (false alarms)"
    rows += layouts
    for name, one in content["real_sensors"].items():
        trials = f"real presses `{name}`, {one['trials']} trials"
        rows.append([f"{trials}: as it should be (false alarms)", _percent(one["right"])])
        rows.append([f"{trials}: background taken in contact", _percent(one["touched"])])
    return ["what is given", "alarms, [checks]"], rows


def diameters() -> Table:
    """What becomes of a wrong diameter of the ball."""
    rows = [
        [f"{one['factor']:.2g}", _percent(one["doubted"]), _percent(one["refused"])]
        for one in report("checks")["ball_diameter"]["given"]
    ]
    return ["diameter given, over the true one", "warned or refused", "refused"], rows


def contacts() -> Table:
    """Presses that the contact decision misses."""
    rows = []
    for what, bins in report("checks")["contact"]["missed"].items():
        rows += [
            [what, f"{one['from_mm']:g} to {one['to_mm']:g} mm", one["touches"], _percent(one["missed"])]
            for one in bins
            if one["touches"]
        ]
    return ["object", "pressed", "touches", "missed"], rows


def brightness() -> Table:
    """What the contact decision makes of a change of light."""
    rows = [
        [f"{_percent(one['brighter'])} brighter", _percent(one["false_contacts"])]
        for one in report("checks")["contact"]["false"]
    ]
    return ["no contact, and the light", "taken for contact"], rows


def single_touch() -> Table:
    """How far one touch tells where it is."""
    rows = []
    for name, light in (("single_touch", "TACTO's"), ("single_touch_random", "of random sensors")):
        one = report(name)["summary"]
        keys = ("normalised_top25_error", "median_of_medians", "normalised_by_single_random")
        rows.append([light, *(f"{one[key]:.3f}" for key in keys), f"[{name}]"])
    rows.append(["*paper; its image embedding*", "0.473; 0.546", "-", "-", "-"])
    return ["light", "mean", "median of medians", "against one random entry", "report"], rows


def speed() -> Table:
    """Each stage on two shared cores."""
    one = report("bench")
    step, fine = one["filter_ms"], one["fine_stage_ms"]
    rows = [
        ["depth network, p50", f"{one['tdn_ms']['p50']:.1f} ms"],
        ["code network, p50", f"{one['tcn_ms']['p50']:.1f} ms"],
        ["filter step with 50k; 10k; 1k particles, p50", "; ".join(f"{step[n]['p50']:.1f}" for n in _SIZES) + " ms"],
        ["fine stage with 50k; 1k particles, p50", "; ".join(f"{fine[n]['p50']:.1f}" for n in _SIZES[::2]) + " ms"],
        ["image to estimate with 50k particles", f"{one['end_to_end_hz']:.0f} Hz"],
        ["image to estimate once converged", f"{one['converged_hz']:.0f} Hz"],
        [
            "look-up of 50k particles: spread; converged",
            _two(one["lookup_ms"]["50000"], one["lookup_converged_ms"]["50000"]),
        ],
        [
            "... that finds the exact nearest entry",
            f"{_percent(one['lookup_exact_share']['spread'], 1)}; {_percent(one['lookup_exact_share']['converged'])}",
        ],
        ["renders of 240 x 320", f"{one['renders_per_s']:.0f} a second"],
        [
            "simulated images of `digit_sim` on one core: additive; relative light",
            "; ".join(f"{1e3 / one['sim_image_ms'][light]['cpu']:.0f}" for light in _LIGHTS) + " a second",
        ],
        ["codebook poses", f"{one['codebook_poses_per_s']:.0f} a second"],
        ["the paper's networks, FCRN; MinkLoc3D", f"{one['fcrn_ms']['p50']:.0f}; {one['minkloc3d_ms']['p50']:.0f} ms"],
        [
            "the filter's process: active after, p50; longest",
            f"{one['filter_start_s']['p50']:.1f}; {one['filter_start_s']['max']:.1f} s",
        ],
        ["... its memory then", f"{one['filter_rss_mb']:.0f} MiB"],
        [
            "age of an image when its transform is found, beside 500 Hz of transforms: p50; p95",
            f"{one['pose_age_ms']['p50']:.0f}; {one['pose_age_ms']['p95']:.0f} ms",
        ],
    ]
    return ["what", "[bench]"], rows


_LIGHTS = ("additive", "relative")
_SIZES = ("50000", "10000", "1000")


def _two(first: dict, second: dict) -> str:
    return f"{first['p50']:.1f}; {second['p50']:.1f} ms"


def load() -> Table:
    """Images at the sensor's rate, over the time that the paper's depth network takes on the same machine."""
    header = ["object", "minutes", "images answered", "image to pose, p50; p99", "over FCRN's time"]
    rows, fcrn = [], report("bench")["fcrn_ms"]["p50"]
    for name in ("load_eyebolt", "load_mug"):
        one = report(name)
        times = [one["load"]["image_to_pose_ms"][share] for share in ("p50", "p99")]
        rows.append([
            one["object"], f"{one['minutes']:.0f}", _of(one["load"]["answered"], one["load"]["sent"]),
            "{:.0f}; {:.0f} ms".format(*times), "{:.3f}; {:.2f}".format(*(each / fcrn for each in times)), f"[{name}]",
        ])  # fmt: skip
    return [*header, "report"], rows


def soak() -> Table:
    """Load and faults."""
    one = report("soak")
    load, killed, late, plug = one["load"], one["killed"], one["transforms_200_ms_late"], one["unplugged"]
    steps, refused = one["filter"], one["malformed"]["refused"]
    milliseconds, rss = load["image_to_pose_ms"], load["resident_mb"]
    rows = [
        [f"{load['fps']:.0f} images a second for {load['seconds'] / 60:.0f} minutes: answered by a pose",
         _of(load["answered"], load["sent"])],
        ["... image to pose, p50; p99", f"{milliseconds['p50']:.0f}; {milliseconds['p99']:.0f} ms"],
        ["... growth of `tdn`; `tcn`; `particle_filter`",
         "; ".join(f"{rss[n]['growth']:.1f}" for n in ("tdn", "tcn", "particle_filter")) + " MiB"],
        *([f"`{name}` killed: first pose after", f"{each['back_after_s']:.1f} s"] for name, each in killed.items()),
        [f"sensor unplugged for {plug['for_s']:.0f} s: ERROR; `stale`; pose again after",
         f"{plug['error_after_s']:.1f}; {plug['stale_after_s']:.1f}; {plug['back_after_s']:.1f} s"],
        ["transforms 200 ms late: images given up", _of(late["given_up"], late["sent"])],
        ["... image to pose, p50", f"{late['image_to_pose_ms']['p50']:.0f} ms"],
        [f"{one['malformed']['of_each_topic']} malformed messages on each of {len(one['malformed']['topics'])} topics:"
         f" refused by {'; '.join(f'`{name}`' for name in refused)}",
         "; ".join(str(sum(each.values())) for each in refused.values())],
        [f"bag looped {one['looped_bag']['loops']:.0f} times: frames lost", one["looped_bag"]["lost"]],
        ["two sensors: frames answered",
         " and ".join(_of(each["answered"], each["sent"]) for each in one["two_sensors"].values())],
        [f"disk full: files left half written by {len(one['full_disk']['writers'])} writers",
         one["full_disk"]["left_behind"]],
        [f"{steps['steps']} filter steps: deviation from a rotation; growth",
         f"{steps['orthonormality']:.0e}; {steps['resident_mb']['growth']:.1f} MiB"],
    ]  # fmt: skip
    return ["what", "[soak]"], rows


def commands() -> Table:
    """What made each report."""
    return ["report", "made by"], [[f"[{name}]", f"`{_made_by(name)}`"] for name in reported()]


def _made_by(name: str) -> str:
    """The command that the report names itself, without where it wrote to; that of `COMMANDS` if it names none."""
    return re.sub(r" --json \S+", "", report(name).get("command") or COMMANDS[name])


TABLES = {
    table.__name__: table
    for table in (
        paper, localisation, converged, weights, regions, events, identification, exploration, twins, start, codebooks,
        real, grasps, peers,
        variants, slides, depth, presses, labels, checks, diameters, contacts, brightness, single_touch, speed, load,
        soak, commands,
    )
}  # fmt: skip


def filled(document: str) -> str:
    """The text of a document, its tables made anew."""
    path = ROOT / document
    up = "../" * (len(path.relative_to(ROOT).parts) - 1)

    def table(match: re.Match) -> str:
        header, rows = TABLES[match[2]]()
        lines = [header, ["---"] * len(header), *rows]
        text = "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
        for name in reported():
            text = text.replace(f"[{name}]", f"[{name}]({up}{report_path(name).relative_to(ROOT).as_posix()})")
        return f"{match[1]}{text}\n{match[3]}"

    return re.sub(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", table, path.read_text(), flags=re.S)


if __name__ == "__main__":
    for name in DOCUMENTS:
        (ROOT / name).write_text(filled(name))
