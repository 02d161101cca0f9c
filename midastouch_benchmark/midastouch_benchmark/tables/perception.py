"""Tables of the networks, the sensor calibration, the checks of a sensor, and the effect of soft gel on all of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from ..single_touch.matches import TOP
from ..statistics.intervals import bootstrap_interval, error_ratio
from .reports import COMMANDS, OPTICS, benchmark_summary, report, reported, rows_of
from .table import Form, Row, Table, between, fraction, is_missing, listed, percent, pose, text, value, with_row

_GEL: dict[str, Form] = {
    "gel": lambda row: "as fitted" if is_missing(row["thickness_mm"]) else f"elastic, {row['thickness_mm']:g} mm",
    "calibrated": lambda row: "yes" if row["calibrated"] else "no",
}


def soft_gel(content: dict | None = None) -> pd.DataFrame:
    """Table of soft gel's effect on maps, poses and codes: medians, and the 90 % range of errors along the normal."""
    content = content or report("soft_gel")
    rows = []
    for kind, group in _of_gels(content["touches"]):
        normal = bootstrap_interval(group["normal_mm"], group["object"].tolist(), np.median)
        spread = {f"q{k}": group["normal_mm"].quantile(k / 100) for k in (5, 95)}
        one_touch = group["best_m"].sum() / group["random_m"].sum()
        middle = group.drop(columns=list(kind)).median(numeric_only=True)
        rows.append(kind | {"trials": len(group), "normal": normal, "one_touch": one_touch} | spread | dict(middle))

    def along_the_normal(row: Row) -> str:
        most = f"{row['q5']:+.2f} to {row['q95']:+.2f}"
        return f"{row['normal_mm']:+.2f} mm ({between(row['normal'], '{:+.2f}')}; 90 %: {most})"

    claims = {
        "deepest over the object's": text("deepest", "{:.2f}"),
        "area over the object's": text("area", "{:.2f}"),
        "pose off along the normal": along_the_normal,
        "across": text("tangential_mm", "{:.2f} mm"),
        "tilt": text("tilt_deg", "{:.1f} deg"),
        "one touch": text("one_touch", "{:.3f}"),
    }
    return Table(_GEL | {"touches": text("trials")}, claims).of(rows)


def commanded_depth(content: dict | None = None) -> pd.DataFrame:
    """Table of errors of the depth that is read from presses of a known depth on soft gel."""
    claims = {
        "depth less the commanded one, median": text("bias", "{:+.2f} mm"),
        "error, median": lambda row: f"{row['error']:.2f} mm ({between(row['interval'], '{:.2f}')})",
    }
    about = {"pressed in": text("press")} | _GEL | {"presses": text("trials")}
    return Table(about, claims).of(commanded_depths(content or report("soft_gel")))


def commanded_depths(content: dict) -> Iterator[dict]:
    """Yield a row for each kind of press and gel of a result: the pressed shape, the number of presses, median bias and
    error [mm] of the depth that is read."""
    for kind, group in _of_gels(content["presses"], "press"):
        off = group["depth_mm"] - group["commanded_mm"]
        interval = bootstrap_interval(off.abs(), range(len(off)), np.median)
        figures = {"bias": off.median(), "error": off.abs().median(), "interval": interval}
        yield kind | {"trials": len(off)} | figures


def _of_gels(rows: list[dict], *further: str) -> Iterator[tuple[dict, pd.DataFrame]]:
    """Yield (keys, rows) for each calibration, thickness and `further` key in rows of a result."""
    keys = [*further, "calibrated", "thickness_mm"]
    frame = pd.DataFrame(rows).sort_values(keys, na_position="first", kind="stable")
    for kind, group in frame.groupby(keys, dropna=False, sort=False):
        yield dict(zip(keys, kind, strict=True)), group


_WANTED = {
    "with 10 others": ((0.95, 1.05), (0.93, 1.07), 0.05, 0.9),
    "the model's": ((0.9, 1.1), (0.85, 1.15), 0.07, 0.85),
}
"""Bounds wanted of presses, by calibration: least and most of measured over true radius and of deepest over deepest,
largest RMSE inside [mm], least correlation."""
_WANTED_DEPTH = {"ball": 0.05, "flat face": 0.12}
"""Largest error of the depth [mm], by what is pressed in."""
_USUAL_GEL = 3.0  # mm thick
_PRESSES = [name for name in COMMANDS if name.startswith("presses_")]
DEPTH: dict[str, Form] = {
    "RMSE, all pixels": text("rmse_mm", "{:.3f} mm"),
    "in contact": text("contact_rmse_mm", "{:.3f} mm"),
    "contact IoU": text("contact_iou", "{:.3f}"),
}
_FITS: dict[str, Form] = {
    "RMSE inside": text("rmse_in_circle_mm", "{:.2f} mm"),
    "deepest over deepest": text("peak_ratio", "{:.2f}"),
    "correlation of both": text("depth_correlation", "{:.2f}"),
    "centres apart": text("centre_mm", "{:.2f} mm"),
}
"""Columns that compare a measured press with the ball that should have made it."""
PRESSES: dict[str, Form] = {
    "RMSE inside": _FITS["RMSE inside"],
    "deepest measured over deepest of the ball": _FITS["deepest over deepest"],
    "correlation of both": _FITS["correlation of both"],
    "measured radius": text("felt_radius_mm", "{:.1f} mm"),
    "IoU": text("iou", "{:.2f}"),
    "by 10 % of light": text("brightness_mm", "{:.3f} mm"),
}
_SHAPE: dict[str, Form] = {
    "recall": percent("recall"),
    "bulging": percent("bulges_share"),
    "IoU with that ball": text("iou_ideal", "{:.2f}"),
    "centre off by": _FITS["centres apart"],
    "roundness": text("roundness", "{:.2f}"),
    "penetration outside contact and shadow": percent("outside_share"),
}
_TOUCH: dict[str, Form] = {
    "mean": text("summary.normalised_top25_error", "{:.3f}"),
    "median of medians": text("summary.median_of_medians", "{:.3f}"),
    "against one random entry": text("summary.normalised_by_single_random", "{:.3f}"),
}
_TOUCHES: dict[str, Form] = {
    "touches": text("queries"),
    "missed": text("missed"),
    "mean": _TOUCH["mean"],
    "median": text("summary.median", "{:.3f}"),
    "geodesic": text("summary.geodesic_normalised_top25_error", "{:.3f}"),
    "perfect": text("summary.nearest_entry", "{:.3f}"),
    "against one random entry": _TOUCH["against one random entry"],
    "random": lambda row: f"{1e3 * row['summary.random_error']:.1f} mm",
}


def real() -> pd.DataFrame:
    """Table of errors over ten objects through the optics of measured sensors, against TACTO's on the same slides."""

    def row(name: str) -> dict:
        ratio = error_ratio(report(name)["trials"], report("real_plain")["trials"])
        return {key: one for key, one in benchmark_summary(name).items() if key != "objects"} | {"ratio": ratio}

    claims = {
        "particles, mean": pose("e", "mean"),
        "closest mode, median": pose("closest_mode", "median"),
        "right": fraction("trust.right_at_end"),
        "mean error over TACTO's": lambda row: "{:.2f} ({:.2f}...{:.2f})".format(
            *(row[f"ratio.{key}"] for key in ("value", "low", "high"))
        ),
        "median of pairs": text("ratio.median", "{:.2f}"),
    }
    return Table({"optics": text("what")}, claims).of(rows_of(OPTICS, row), "report")


def depth() -> pd.DataFrame:
    """Table of errors of the depth network on simulated slides, whose true depth is known."""
    names = {
        "evaluate_tdn": "three slides of another renderer",
        "evaluate_tdn_held_out": "our slides over seven scans that only validate",
    }
    table = Table({"slides": text("what")} | DEPTH).of(rows_of(names, lambda name: report(name)["summary"]), "report")
    return with_row(table, {"slides": "*paper*", "RMSE, all pixels": "0.135 mm"})


def depth_table(content: dict) -> pd.DataFrame:
    """Table of an `evaluate-perception tdn` result: a row for each sequence, and one for all of them."""
    rows = [{"what": one["sequence"]} | one for one in content["sequences"]] + [{"what": "all"} | content["summary"]]
    about = {"slides": text("what"), "frames": text("frames", "{:.0f}")}
    return Table(about | DEPTH | {"a frame": text("ms_per_frame", "{:.1f} ms")}).of(rows)


def labels() -> pd.DataFrame:
    """Table of labels and of measurements of DIGIT presses, both against the balls that the images show."""
    rows = []
    for sensor in ("d20641", "vocdex"):
        plain, calibrated = (report(f"presses_{sensor}{how}") for how in ("", "_calibrated"))
        for what, content, key in (
            ("labels against images", plain, "labels"),
            ("measured without calibration, against images", plain, "against_fit"),
            ("measured with calibration, against images", calibrated, "against_fit"),
        ):
            ball = f"{1e3 * plain['ball_diameter']:.1f} mm"
            rows.append({"ball": ball, "what": what} | (content.get(key) or {}))
    return Table({"ball": text("ball"), "what": text("what")} | _FITS).of(rows)


def _press_row(content: dict) -> dict:
    others, calibration = content.get("calibrated_with"), content.get("calibration")
    without = "the model's" if content.get("model_calibration") else "without"
    how = f"with {others} others" if others else Path(calibration).name if calibration else without
    summary = content["summary"]
    judged = {} if summary.get("truth") != "felt outline" else dict.fromkeys(
        ("rmse_in_circle_mm", "peak_ratio", "depth_correlation", "iou_ideal", "centre_mm")
    )  # fmt: skip
    ball = f"{1e3 * content['ball_diameter']:.1f} mm, {summary['presses']} times"
    return {"ball": ball, "how": how, "truth": summary.get("truth", "labels")} | summary | judged


def presses() -> pd.DataFrame:
    """Table of depth on two DIGITs and a GelSight Mini, against the ball under the labelled outline."""
    rows = rows_of(dict.fromkeys(_PRESSES, "-"), lambda name: _press_row(report(name)))
    return Table({"ball": text("ball"), "calibration": text("how")} | PRESSES).of(rows, "report")


def presses_table(content: dict) -> pd.DataFrame:
    """Table of an `evaluate-perception presses` result; depth is not judged by the network's own outline."""
    row = {"what": Path(content["folder"]).name, "network": content["network"]} | _press_row(content)
    others = (("against_fit", "by the images' ball"), ("labels", "labels, by the images' ball"))
    more = [row | {"what": what, "brightness_mm": None} | content[key] for key, what in others if content.get(key)]
    about = {"presses": text("what"), "network": text("network"), "ball": text("ball"), "calibration": text("how")}
    return Table(about | {"outline": text("truth")} | PRESSES | _SHAPE).of([row, *more])


def wanted() -> pd.DataFrame:
    """Table of wanted bounds for the readings of real and simulated sensors, measured values, and bounds missed."""
    checks = report("checks")
    gels, slow_light = checks["gels"], max(row["false_contacts"] for row in checks["slow_light"])
    tacto = report("evaluate_tdn")["summary"]
    rows = [
        *_wanted_of_presses(),
        ("slow change of the light that is taken for a contact", slow_light, 3, None, 0),
        ("another gel's calibration is refused", gels["another gel's calibration"]["said"], 2, 0.95, None),
        ("a gel's own calibration is refused", gels["its own calibration, in another light"]["said"], 2, None, 0),
        ("slides of another renderer: RMSE, mm", tacto["rmse_mm"], 3, None, 0.050),
        ("slides of another renderer: IoU", tacto["contact_iou"], 3, 0.965, None),
    ]
    for row in commanded_depths(report("soft_gel")):
        if row["calibrated"] and row["thickness_mm"] == _USUAL_GEL:
            about = f"{row['press']} on elastic gel of {_USUAL_GEL:g} mm, calibrated: error of the depth, mm"
            rows.append((about, row["error"], 2, None, _WANTED_DEPTH[row["press"]]))
    for name, how, most in (("real_sensor", "", 1.2), ("real_sensor_calibrated", " calibrated", 1.05)):
        ratio = error_ratio(report(name)["trials"], report("real_plain")["trials"])["value"]
        rows.append((f"slides: error through{how} real sensors, over TACTO's", ratio, 2, None, most))
    bench = report("bench")
    for key, how in (("tdn_ms", ""), ("calibrated_tdn_ms", ", calibrated, integration included")):
        rows.append(
            (f"depth network over FCRN's time{how}", bench[key]["p50"] / bench["fcrn_ms"]["p50"], 3, None, 0.013)
        )
    for name, light, most in (("single_touch", "TACTO's light", 0.30), ("single_touch_random", "random sensors", 0.38)):
        error = report(name)["summary"]["normalised_top25_error"]
        rows.append((f"one touch, {light}: mean error", error, 3, None, most))
    return listed(("what", "wanted", "measured", "missed"), (_judged(*row) for row in rows))


def _wanted_of_presses() -> Iterator[tuple]:
    """Yield the rows on presses; DIGITs are judged by the balls in the images: their labels are off by the bound."""
    radii = {}
    for name in _PRESSES:
        one = report(name)
        how = _press_row(one)["how"]
        if how not in _WANTED:
            continue
        ball, summary = 1e3 * one["ball_diameter"], one.get("against_fit") or one["summary"]
        radii[how, ball] = summary["felt_radius_mm"]
        about, (radius, peak, rmse, correlation) = f"ball of {ball:.2f} mm, calibration {how}", _WANTED[how]
        yield f"{about}: measured over true radius", summary["felt_radius_mm"] / (0.5 * ball), 2, *radius
        yield f"{about}: deepest over deepest", summary["peak_ratio"], 2, *peak
        yield f"{about}: RMSE inside, mm", summary["rmse_in_circle_mm"], 2, None, rmse
        yield f"{about}: correlation", summary["depth_correlation"], 2, correlation, None
    large, small = (radii["the model's", ball] for ball in (9.5, 6.31))
    yield "radii of the balls of 9.50 and 6.31 mm, calibration the model's: ratio", large / small, 2, 1.4, 1.6


def _judged(what: str, value: float, digits: int, least: float | None, most: float | None) -> tuple[str, ...]:
    """Return a row of `wanted`: the bound, and whether the value, rounded as printed, meets it."""
    value = round(value, digits)
    bounds = [("at least", least), ("at most", most)]
    said = " and ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)
    met = (least is None or value >= least) and (most is None or value <= most)
    return what, said, f"{value:.{digits}f}", "" if met else "missed"


def single_touch() -> pd.DataFrame:
    """Table of pose errors of the best matches of a single touch, by light, with the paper's."""
    names = {"single_touch": "TACTO's", "single_touch_random": "of random sensors"}
    rows = rows_of(names, lambda name: {"summary": report(name)["summary"]})
    paper = {"light": "*paper; its image embedding*", "mean": "0.473; 0.546"}
    return with_row(Table({"light": text("what")} | _TOUCH).of(rows, "report"), paper)


_COMPARED_BY = {
    "tcn": "our codes",
    "measured_maps": "measured map, with each pose",
    "true_maps": "true map, with each pose",
    "nearest_entry": "*nearest pose of the codebook*",
}


def single_touch_limit() -> pd.DataFrame:
    """Table of pose errors of a single touch that is compared with every pose, from the newest report."""
    name = "single_touch_limit"
    return single_touch_limits(report(name)["exhaustive"] if name in reported() else {}, "report")


def single_touch_limits(ways: dict, sources: str | None = None) -> pd.DataFrame:
    """Table of the exhaustive comparisons of a `single-touch` result, a row for each way to compare a touch."""
    rows = [
        {"what": what, "report": "single_touch_limit", "measured": way in ways} | ways.get(way, {})
        for way, what in _COMPARED_BY.items()
    ]
    claims = {
        "touches": text("trials"),
        "mean error": value("error", "{:.2f}"),
        "more than by our codes": value("over_codes", "{:+.2f}"),
    }
    return Table({"compared by": text("what")}, claims).of(rows, sources)


def single_touch_table(content: dict) -> pd.DataFrame:
    """Table of the paper's figure 14: objects of a `single-touch` result, the best first, and their mean."""
    objects = sorted(content["objects"], key=lambda one: one["summary"]["normalised_top25_error"])
    rows = [*objects, *([content] if len(objects) > 1 else [])]
    known = ({key: one[key] for key in ("object", "queries", "missed", "summary")} for one in rows)
    return Table({"object": text("object")} | _TOUCHES).of(known)


def single_touch_notes(content: dict) -> list[str]:
    """Return the notes that explain the columns of `single_touch_table`."""
    notes = [
        f"pose error (6-vectors) of the nearest of the {TOP} best matches, over that of {TOP} random touches; "
        "geodesic: with the angle on SO(3)",
        "perfect: of the book's nearest entry; one random: over the error of a single random touch, the paper's other "
        "reading",
    ]
    if len(content["objects"]) > 1:
        average = content["summary"]["median_of_medians"]
        notes.append(
            f"median over objects of the medians: {average:.3f}; so the authors average (paper, ten test objects: "
            "0.473, image embedding 0.546)"
        )
    return notes
