"""Tables of the filter against other methods and against itself: fewer poses, parts off, other contacts."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from ..statistics.accuracy import counted_anew, pose_right_at_end
from ..statistics.comparison import pareto_front, verdict
from ..statistics.intervals import ENOUGH
from ..trials.protocols import HOLDS
from ..trials.variants import DEFAULT, PRESET
from .reports import ABLATIONS, frame_of, report, reported
from .table import Form, Row, between, fraction, is_missing, percent, pose, text, tidy, value, written

COMPARED: dict[str, Form] = {
    "particles, mean": lambda row: f"{row['e_trans_mm']:.1f} mm, {row['e_rot_deg']:.1f} deg",
    "paired difference": lambda row: _difference(row, "difference_mm", "{:+.1f}", " mm"),
    "right": lambda row: f"{row['right'] * row['trials']:.0f} of {row['trials']:.0f}",
    "frames converged wrong": percent("wrong_converged", 1),
    "CPU a frame; against the default": lambda row: f"{row['cpu_ms_filter']:.1f} ms; {verdict(row)}",
}
"""Columns on a variant against the default on the same trials, of a row of `compare_variants`."""
METHODS: dict[str, Form] = {
    "published pose, median": pose("estimate", "median", "trust.estimate_trans_mm.median.interval"),
    "pose right, in any state": fraction("pose_right"),
    "right": fraction("trust.right_at_end"),
    "frames converged wrong": fraction("trust.converged_wrong", 1),
    "CPU a frame": value("trust.filter_cpu_ms.mean", "{:.1f}", " ms"),
}
GRASPS: dict[str, Form] = {
    "closest mode found": fraction("found"),
    "probability at the true pose": fraction("share"),
    "pose right": fraction("right"),
    "converged": fraction("converged"),
    "converged wrong": fraction("converged_wrong"),
}


def _difference(row: Row, key: str, form: str, unit: str = "") -> str:
    if is_missing(row[key]):
        return "-"
    return f"{form.format(row[key])}{unit} ({between(row[f'{key}_interval'], form)})"


def compared_frame(content: dict, **about: object) -> pd.DataFrame:
    """Return a tidy frame of a result's comparison, with each variant's summary and group; about: added to each row."""
    words = {name: {key: each[key] for key in ("summary", "group")} for name, each in content["variants"].items()}
    return tidy(one | words[one["variant"]] | about for one in content["comparison"])


def compared_table(content: dict) -> pd.DataFrame:
    """Table of variants of a result of `midastouch benchmark` against its default, by start."""
    about = {"start": text("init"), "variant": text("variant"), "trials": text("trials"), "filter": text("summary")}
    return written(compared_frame(content), about | COMPARED, {})


def methods_table(content: dict, init: str) -> pd.DataFrame:
    """Table of the default and other methods behind the same networks, of one start of a `midastouch benchmark`."""
    rows = [
        {"what": content["variants"][name]["summary"], "pose_right": pose_right_at_end(some)}
        | {key: each for key, each in counted_anew(by_init[init], some).items() if key != "objects"}
        for name, by_init in content["summary"].items()
        if "trust" in by_init.get(init, {})
        and (some := [t for t in content["trials"] if (t["variant"], t["init"]) == (name, init)])
    ]
    return written(tidy(rows), {"method": text("what"), "trials": text("trials")}, METHODS)


def grasps_table(grasps: Mapping[str, list[dict]]) -> pd.DataFrame:
    """Table of the belief while grasps are held; grasps: by label, a summary for each time of `HOLDS`."""
    return written(tidy(_held(grasps)), {"contacts": text("what"), "held": text("seconds", "{} s")}, GRASPS)


def _held(grasps: Mapping[int, list[dict]] | Mapping[str, list[dict]], **about: object) -> list[dict]:
    pairs = ((what, zip(HOLDS, each, strict=True)) for what, each in grasps.items())
    return [{"what": what, "seconds": after} | about | one for what, each in pairs for after, one in each]


def baselines() -> pd.DataFrame:
    """Table of other methods behind the same networks, on the same trials."""
    if "peers" not in reported():
        return written(frame_of({"peers": "-"}, report), {"method": text("what"), "trials": text("trials")}, METHODS)
    content = report("peers")
    (init,) = content["summary"][DEFAULT]
    table = methods_table(content, init)
    for name, why in content["skipped_variants"].items():
        table.loc[len(table)] = [name, "-", f"skipped: {why.partition(':')[0]}", *["-"] * (len(METHODS) - 1)]
    return table


def grasps() -> pd.DataFrame:
    """Table of grasps without sliding, by the number of fingers that touch."""
    about = {"objects": text("objects"), "contacts": text("what"), "held": text("seconds", "{} s")}
    rows: list[dict] = []
    for name, objects in {"grasp": "the ten", "grasp_cad": "CAD parts"}.items():
        if name not in reported():
            continue
        by_variant = {name: one["held"] for name, each in report(name)["summary"].items() for one in each.values()}
        contacts = {k: by_variant[v] for k, v in enumerate(("contact_1", "contacts_2", DEFAULT), 1)}
        rows += _held(contacts, objects=objects, report=name)
    frame = tidy(rows) if rows else frame_of({"grasp": "-"}, report)
    return written(frame, about if rows else {"contacts": text("what")}, GRASPS, "report")


def variants() -> pd.DataFrame:
    """Table of the effect of each part of the filter, under the protocols that exercise it."""
    frames, there = [], reported()
    for name, what in ABLATIONS.items():
        if name in there:
            frames.append(compared_frame(report(name), what=what, report=name))
        else:
            frames.append(frame_of({name: what}, report))
    about = {"conditions": text("what"), "filter": text("summary")}
    return pd.concat([written(frame, about, COMPARED, "report") for frame in frames], ignore_index=True)


def front() -> pd.DataFrame:
    """Table of run time and error of the default, the presets, and settings with more or less work, poses or modes;
    fastest first."""
    if "front" not in reported():
        return written(frame_of({"front": "-"}, report), {"filter": text("what")}, COMPARED, "report")
    return front_table(report("front"))


def front_table(content: dict) -> pd.DataFrame:
    """Table `front` of a result of `midastouch benchmark --variant front`."""
    best = [one["variant"] for one in pareto_front(content["comparison"], "e_trans_mm")]
    frame = compared_frame(content, report="front").sort_values("cpu_ms_filter", kind="stable")
    if (trials := frame["trials"].iloc[0]) < ENOUGH:  # one row stands for all
        frame = tidy([{"summary": f"{len(frame)} variants", "trials": trials, "report": "front", "group": ""}])

    def what(row: Row) -> str:
        return f"**{row['summary']}**" if row["group"] in (DEFAULT, PRESET) else row["summary"]

    claims = {"nothing is both faster and more exact": lambda row: "yes" if row["variant"] in best else ""} | COMPARED
    return written(frame, {"filter": what}, claims, "report")
